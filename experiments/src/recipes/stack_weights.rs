//! A9: torques of the weighted stack S1 compared with the hierarchical stack S3, for several ratios of the weights.

use crate::bench::{Bench, RunSpec, count, mean};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::states::{OpenLoop, States};
use analysis::figures::Curves;
use controller::stack::{S1, S3};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A9",
    title: "torques of the weighted stack compared with the hierarchical one, for several ratios of its weights",
    published: "weights that differ by 1e3 or more mimic priorities (footnote 10)",
    robot: "hyq",
    seeds: 1,
    minutes: 1.0,
    run,
};

/// Measures `|τ S1 - τ S3| / |τ S3|`, averaged over the ticks of a trot.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(RunSpec::of("flat_trot").named("states").with("duration_s", "6.0"))?;
    let states = States::read(&sample.log)?;
    let decades: Vec<f64> = (0..=10).map(|k| 0.5 * f64::from(k)).collect();
    let (_, constraints) = S1.split_once("<<").unwrap_or((S1, ""));
    let formula = |decade: f64| {
        let ratio = 10.0_f64.powf(decade);
        format!("\"{:e} contact + {ratio:e} trunk + posture <<{constraints}\"", ratio * ratio)
    };
    let open_loop = |formula: &str| states.controller(&[("stack.formula", formula)]).map(OpenLoop::new);
    let mut hard = open_loop(&format!("{S3:?}"))?;
    let mut soft = decades.iter().map(|&decade| open_loop(&formula(decade))).collect::<anyhow::Result<Vec<_>>>()?;
    let mut distances = vec![Vec::new(); decades.len()];
    let bar = bench.bar("weight ratios");
    for (i, (input, _)) in states.ticks.iter().enumerate() {
        let reference = hard.torques(input)?.map(<[f64]>::to_vec);
        for (soft, distances) in soft.iter_mut().zip(&mut distances) {
            let torques = soft.torques(input)?;
            if let (Some(reference), Some(torques)) = (&reference, torques) {
                let norm = |of: &mut dyn Iterator<Item = f64>| of.map(|x| x * x).sum::<f64>().sqrt();
                let distance = norm(&mut torques.iter().zip(reference).map(|(soft, hard)| soft - hard));
                distances.push(distance / norm(&mut reference.iter().copied()));
            }
        }
        bar(count(i) / count(states.ticks.len()));
    }
    let points: Vec<(f64, f64)> = decades.iter().copied().zip(distances.into_iter().map(mean)).collect();
    let mut rows = Vec::new();
    for (decade, distance) in &points {
        let row = Row::info(format!("ratio 1e{decade}: distance over norm, mean"), 100.0 * distance, "%");
        rows.push(if *decade == 3.0 { row.at_most(5.0) } else { row });
    }
    let rises = points.windows(2).filter(|pair| pair[1].1 > pair[0].1).count();
    rows.push(Row::info("rises along the sweep", count(rises), "").exactly(0.0));
    let curves = Curves {
        x: "ratio of neighbouring weights, power of ten".to_owned(),
        y: "|\u{3c4} S1 \u{2212} \u{3c4} S3| / |\u{3c4} S3|".to_owned(),
        logarithmic: true,
        series: vec![("mean over 6 s of trot".to_owned(), points)],
        limit: Some(("5 %".to_owned(), 0.05)),
    };
    bench.write(&curves.figure("weights"))?;
    Ok(rows)
}
