//! Rough ground: undulation with stones. A stone is a box with a flat top, rounded corners and smooth sides; a plate is a wide stone.

use super::{HeightField, TerrainParams};
use robot_model::math::Rng;
use std::f64::consts::TAU;

/// Density of stones; stones can overlap.
const STONES_PER_M2: f64 = 14.0;

/// Smallest and largest half side of a stone's top, m.
const STONE_HALF_SIDE: [f64; 2] = [0.01, 0.12];

/// Density of plates; they cover a fifth of the ground.
const PLATES_PER_M2: f64 = 0.25;

/// Smallest and largest half side of a plate's top, m.
const PLATE_HALF_SIDE: [f64; 2] = [0.25, 0.6];

/// Generates the height field from a seed.
pub(super) fn rough(params: &TerrainParams, seed: i64) -> HeightField {
    let mut rng = Rng::new(seed, "terrain");
    let [height_min, _] = params.stone_height();
    let waves: Vec<Wave> = (0..6).map(|_| Wave::random(&mut rng, height_min / 12.0)).collect();

    let [extent_x, extent_y] = params.extent();
    let count = (extent_x * extent_y * STONES_PER_M2) as usize;
    let mut stones: Vec<Stone> =
        (0..count).map(|_| Stone::random(&mut rng, params, params.stone_height(), STONE_HALF_SIDE)).collect();
    if let Some(height) = params.plate_height_m {
        let mut rng = Rng::new(seed, "plates");
        let count = (extent_x * extent_y * PLATES_PER_M2) as usize;
        stones.extend((0..count).map(|_| Stone::random(&mut rng, params, height, PLATE_HALF_SIDE)));
    }
    let bins = StoneBins::new(&stones, params.extent());

    let start = params.flat_radius();
    HeightField::sample(params, |x, y| {
        let undulation: f64 = waves.iter().map(|wave| wave.height(x, y)).sum();
        let stone = bins.near(x, y).map(|stone| stone.height(x, y)).fold(0.0, f64::max);
        let growth = smooth_step((libm::hypot(x, y) - start) / (0.5 * start).max(params.cell()));
        growth * (undulation + stone)
    })
}

/// Smooth step: 0 up to `t = 0`, 1 from `t = 1`; slope 0 at both ends, at most 3/2.
fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

struct Wave {
    amplitude: f64,
    wave_vector: [f64; 2],
    phase: f64,
}

impl Wave {
    fn random(rng: &mut Rng, amplitude: f64) -> Self {
        let wave_number = TAU / rng.uniform(0.6, 1.6);
        let direction = rng.uniform(0.0, TAU);
        Wave {
            amplitude,
            wave_vector: [wave_number * libm::cos(direction), wave_number * libm::sin(direction)],
            phase: rng.uniform(0.0, TAU),
        }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.amplitude * libm::sin(self.wave_vector[0] * x + self.wave_vector[1] * y + self.phase)
    }
}

struct Stone {
    centre: [f64; 2],
    axis: [f64; 2],
    half_top: [f64; 2],
    height: f64,
    side_width: f64,
}

impl Stone {
    fn random(
        rng: &mut Rng,
        params: &TerrainParams,
        [height_min, height_max]: [f64; 2],
        [side_min, side_max]: [f64; 2],
    ) -> Self {
        let [extent_x, extent_y] = params.extent();
        let turn = rng.uniform(0.0, TAU);
        let height = rng.uniform(height_min, height_max);
        Stone {
            centre: [rng.uniform(-0.5, 0.5) * extent_x, rng.uniform(-0.5, 0.5) * extent_y],
            axis: [libm::cos(turn), libm::sin(turn)],
            half_top: [rng.uniform(side_min, side_max), rng.uniform(side_min, side_max)],
            height,
            side_width: 1.5 * height / params.stone_slope(),
        }
    }

    /// Distance from the centre beyond which the stone has height 0, m.
    fn reach(&self) -> f64 {
        libm::hypot(self.half_top[0], self.half_top[1]) + self.side_width
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        let [dx, dy] = [x - self.centre[0], y - self.centre[1]];
        let along = (self.axis[0] * dx + self.axis[1] * dy).abs() - self.half_top[0];
        let across = (self.axis[0] * dy - self.axis[1] * dx).abs() - self.half_top[1];
        let distance = libm::hypot(along.max(0.0), across.max(0.0));
        self.height * smooth_step(1.0 - distance / self.side_width)
    }
}

/// Stones in square bins, so that the height of a point needs only the stones of neighbouring bins.
struct StoneBins<'a> {
    size: f64,
    columns: usize,
    half_extent: [f64; 2],
    bins: Vec<Vec<&'a Stone>>,
}

impl<'a> StoneBins<'a> {
    fn new(stones: &'a [Stone], extent: [f64; 2]) -> Self {
        let size = stones.iter().map(Stone::reach).fold(0.1, f64::max);
        let [columns, rows] = extent.map(|side| (side / size) as usize + 1);
        let mut grid = StoneBins {
            size,
            columns,
            half_extent: extent.map(|side| side / 2.0),
            bins: vec![Vec::new(); rows * columns],
        };
        for stone in stones {
            let [row, column] = grid.bin(stone.centre[0], stone.centre[1]);
            grid.bins[row * columns + column].push(stone);
        }
        grid
    }

    fn bin(&self, x: f64, y: f64) -> [usize; 2] {
        let index =
            |value: f64, half: f64, count: usize| (((value + half) / self.size).max(0.0) as usize).min(count - 1);
        let rows = self.bins.len() / self.columns;
        [index(y, self.half_extent[1], rows), index(x, self.half_extent[0], self.columns)]
    }

    fn near(&self, x: f64, y: f64) -> impl Iterator<Item = &'a Stone> {
        let [row, column] = self.bin(x, y);
        let rows = self.bins.len() / self.columns;
        (row.saturating_sub(1)..=(row + 1).min(rows - 1)).flat_map(move |row| {
            (column.saturating_sub(1)..=(column + 1).min(self.columns - 1))
                .flat_map(move |column| self.bins[row * self.columns + column].iter().copied())
        })
    }
}
