//! Statistics of a list of samples.

use serde::Serialize;

/// Statistics of an error signal, in the unit of the signal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorStats {
    /// Number of samples.
    pub count: u64,
    /// Mean of the signed error.
    pub mean: f64,
    /// Standard deviation, normalized by `count`.
    pub std: f64,
    /// `sqrt(mean² + std²)`.
    pub rms: f64,
    /// Mean of the absolute error.
    pub mean_abs: f64,
    /// Largest absolute error.
    pub max_abs: f64,
}

impl ErrorStats {
    /// `None` without samples. NaN samples are ignored.
    pub fn of(samples: impl IntoIterator<Item = f64>) -> Option<Self> {
        let samples: Vec<f64> = samples.into_iter().filter(|e| !e.is_nan()).collect();
        if samples.is_empty() {
            return None;
        }
        let n = samples.len() as f64;
        let (mean, std) = mean_and_std(&samples)?;
        Some(Self {
            count: samples.len() as u64,
            mean,
            std,
            rms: (mean * mean + std * std).sqrt(),
            mean_abs: samples.iter().map(|e| e.abs()).sum::<f64>() / n,
            max_abs: samples.iter().fold(0.0, |max, e| e.abs().max(max)),
        })
    }
}

/// Distribution of samples, in the unit of the samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// Number of samples.
    pub count: u64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation, normalized by `count`.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Largest.
    pub max: f64,
}

impl Distribution {
    /// `None` without samples. NaN samples are ignored.
    pub fn of(samples: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = samples.into_iter().filter(|x| !x.is_nan()).collect();
        sorted.sort_by(f64::total_cmp);
        let errors = ErrorStats::of(sorted.iter().copied())?;
        Some(Self {
            count: errors.count,
            mean: errors.mean,
            std: errors.std,
            min: sorted[0],
            p50: quantile(&sorted, 0.5),
            p99: quantile(&sorted, 0.99),
            p999: quantile(&sorted, 0.999),
            max: sorted[sorted.len() - 1],
        })
    }
}

/// Mean and standard deviation, normalized by the number of samples; `None` without samples.
pub fn mean_and_std(samples: &[f64]) -> Option<(f64, f64)> {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    (!samples.is_empty()).then(|| (mean, variance.sqrt()))
}

/// Quantile by nearest rank: the smallest sample that is greater than or equal to a fraction `p` of all samples. `sorted` must not be empty.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let rank = (p * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_statistics_of_two_samples() {
        let stats = ErrorStats::of([-1.0, 3.0, f64::NAN]).unwrap();
        let expected = ErrorStats { count: 2, mean: 1.0, std: 2.0, rms: 5.0_f64.sqrt(), mean_abs: 2.0, max_abs: 3.0 };
        assert_eq!(stats, expected);
        assert_eq!(ErrorStats::of([f64::NAN]), None);
    }

    #[test]
    fn nearest_rank_quantiles_of_a_thousand() {
        let stats = Distribution::of((1..=1000).rev().map(f64::from)).unwrap();
        assert_eq!((stats.min, stats.p50, stats.p99, stats.p999, stats.max), (1.0, 500.0, 990.0, 999.0, 1000.0));
        assert_eq!(Distribution::of([7.0]).unwrap().p50, 7.0);
    }
}
