//! The ground: flat, or a height field generated from a seed.
//!
//! A field is a regular grid of heights, triangulated as in MuJoCo, so that [`Terrain::height_at`] and the simulator agree. The ground
//! is flat around the origin, where the robot starts. Randomness is seeded and functions come from `libm`, so a seed gives the same
//! ground on every machine.

mod rough;

use crate::checks::{BadKey, check_range};
use controller::params::exact::optional_array;
use rough::rough;
use serde::Deserialize;

/// Heights are whole multiples of this, m: 61 µm, exact in the simulator's `f32`.
pub const HEIGHT_QUANTUM: f64 = 1.0 / 16384.0;

/// Distance of the plane around a field below its lowest point, m.
const PLANE_DEPTH: f64 = 0.01;

/// Shape of the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TerrainKind {
    /// A plane at height 0.
    Flat,
    /// Smooth undulation with stones, and optionally plates.
    Rough,
    /// A ramp along x.
    Slope,
    /// Stairs along x.
    Steps,
}

/// The `[terrain]` table of a scenario. A key that does not belong to `kind` is an error.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainParams {
    /// Shape of the ground.
    pub kind: TerrainKind,
    /// Size of the field along x and y, m, centred on the origin and surrounded by a plane. Default 12 by 12.
    #[serde(default, deserialize_with = "optional_array")]
    pub extent_m: Option<[f64; 2]>,
    /// Distance between grid points, m. Default 0.04.
    pub cell_m: Option<f64>,
    /// Radius of the flat start, m; `rough` reaches its full height at 1.5 times this radius. Default 0.8.
    pub flat_radius_m: Option<f64>,
    /// `rough`: smallest and largest height of a stone, m. Default 0.02 to 0.04.
    #[serde(default, deserialize_with = "optional_array")]
    pub height_m: Option<[f64; 2]>,
    /// `rough`: largest slope of a stone's sides, rise over run. Default 0.6: a foot slides off and does not get stuck.
    pub stone_slope: Option<f64>,
    /// `rough`: smallest and largest height of the plates between the stones, m. Default: no plates.
    #[serde(default, deserialize_with = "optional_array")]
    pub plate_height_m: Option<[f64; 2]>,
    /// `slope`: angle of the ramp, rad. Default 0.17.
    pub angle_rad: Option<f64>,
    /// `steps`: rise of a step, m. Default 0.05.
    pub step_height_m: Option<f64>,
    /// `steps`: run of a step, m. Default 0.5.
    pub step_length_m: Option<f64>,
}

impl TerrainParams {
    /// Defaults of a kind.
    pub fn of_kind(kind: TerrainKind) -> Self {
        TerrainParams {
            kind,
            extent_m: None,
            cell_m: None,
            flat_radius_m: None,
            height_m: None,
            stone_slope: None,
            plate_height_m: None,
            angle_rad: None,
            step_height_m: None,
            step_length_m: None,
        }
    }

    /// Checks ranges, and that every key belongs to the kind.
    pub(crate) fn check(&self) -> Result<(), BadKey> {
        use TerrainKind::{Flat, Rough, Slope, Steps};
        let [extent_x, extent_y] = self.extent();
        let [stone_min, stone_max] = self.stone_height();
        let [plate_min, plate_max] = self.plate_height_m.unwrap_or_default();
        let field = self.kind != Flat;
        let keys: [(_, _, _, &[f64], _); 9] = [
            ("extent_m", self.extent_m.is_some(), field, &[extent_x, extent_y], 1.0..=40.0),
            ("cell_m", self.cell_m.is_some(), field, &[self.cell()], 0.01..=0.2),
            ("flat_radius_m", self.flat_radius_m.is_some(), field, &[self.flat_radius()], 0.0..=20.0),
            ("height_m", self.height_m.is_some(), self.kind == Rough, &[stone_min, stone_max], 0.0..=0.3),
            ("plate_height_m", self.plate_height_m.is_some(), self.kind == Rough, &[plate_min, plate_max], 0.0..=0.3),
            ("stone_slope", self.stone_slope.is_some(), self.kind == Rough, &[self.stone_slope()], 0.05..=3.0),
            ("angle_rad", self.angle_rad.is_some(), self.kind == Slope, &[self.angle()], -0.6..=0.6),
            ("step_height_m", self.step_height_m.is_some(), self.kind == Steps, &[self.step_height()], -0.3..=0.3),
            ("step_length_m", self.step_length_m.is_some(), self.kind == Steps, &[self.step_length()], 0.1..=5.0),
        ];
        for (key, given, belongs, values, range) in keys {
            if given && !belongs {
                let expected = format!("no such key for terrain of kind {:?}", self.kind).to_lowercase();
                return Err(BadKey { key, found: "given".to_owned(), expected });
            }
            check_range(key, values, range)?;
        }
        for (key, [min, max]) in [("height_m", [stone_min, stone_max]), ("plate_height_m", [plate_min, plate_max])] {
            if min > max {
                let found = format!("[{min}, {max}]");
                return Err(BadKey { key, found, expected: "the smaller height first".to_owned() });
            }
        }
        Ok(())
    }

    fn extent(&self) -> [f64; 2] {
        self.extent_m.unwrap_or([12.0, 12.0])
    }

    fn cell(&self) -> f64 {
        self.cell_m.unwrap_or(0.04)
    }

    fn flat_radius(&self) -> f64 {
        self.flat_radius_m.unwrap_or(0.8)
    }

    fn stone_height(&self) -> [f64; 2] {
        self.height_m.unwrap_or([0.02, 0.04])
    }

    fn stone_slope(&self) -> f64 {
        self.stone_slope.unwrap_or(0.6)
    }

    fn angle(&self) -> f64 {
        self.angle_rad.unwrap_or(0.17)
    }

    fn step_height(&self) -> f64 {
        self.step_height_m.unwrap_or(0.05)
    }

    fn step_length(&self) -> f64 {
        self.step_length_m.unwrap_or(0.5)
    }
}

/// The ground of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    field: Option<HeightField>,
}

/// A grid of heights, row by row along y, points of a row along x.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// Points along x.
    pub columns: usize,
    /// Points along y.
    pub rows: usize,
    /// Distance between points, m.
    pub cell: f64,
    /// Heights in [`HEIGHT_QUANTUM`], length `rows * columns`.
    pub counts: Vec<i32>,
}

impl Terrain {
    /// Generates the ground from a seed.
    pub fn new(params: &TerrainParams, seed: i64) -> Self {
        let start = params.flat_radius();
        let field = match params.kind {
            TerrainKind::Flat => None,
            TerrainKind::Rough => Some(rough(params, seed)),
            TerrainKind::Slope => {
                let rise = libm::tan(params.angle());
                Some(HeightField::sample(params, |x, _| rise * (x - start).max(0.0)))
            }
            TerrainKind::Steps => Some(HeightField::sample(params, |x, _| {
                params.step_height() * ((x - start) / params.step_length() + 1.0).floor().max(0.0)
            })),
        };
        Terrain { field }
    }

    /// The height field; `None` if the ground is a plane.
    pub fn field(&self) -> Option<&HeightField> {
        self.field.as_ref()
    }

    /// Height of the plane, m: the flat ground, or the surroundings of the field.
    pub fn plane_height(&self) -> f64 {
        self.field.as_ref().map_or(0.0, |field| f64::from(field.min_count()) * HEIGHT_QUANTUM - PLANE_DEPTH)
    }

    /// Height of the ground at a point of W, m.
    pub fn height_at(&self, x: f64, y: f64) -> f64 {
        self.field.as_ref().and_then(|field| field.height_at(x, y)).unwrap_or_else(|| self.plane_height())
    }
}

impl HeightField {
    /// Lowest height, in [`HEIGHT_QUANTUM`].
    pub fn min_count(&self) -> i32 {
        self.counts.iter().copied().min().unwrap_or(0)
    }

    /// Highest height, in [`HEIGHT_QUANTUM`].
    pub fn max_count(&self) -> i32 {
        self.counts.iter().copied().max().unwrap_or(0)
    }

    /// Half the size of the field along x and y, m.
    pub fn half_size(&self) -> [f64; 2] {
        [self.columns, self.rows].map(|points| (points - 1) as f64 * self.cell / 2.0)
    }

    /// Samples a surface `height(x, y)`, m.
    fn sample(params: &TerrainParams, height: impl Fn(f64, f64) -> f64) -> Self {
        let cell = params.cell();
        // At least one cell per side. Parameters of a scenario are checked; others are clamped here.
        let points = |extent: f64| (extent / cell).clamp(1.0, 4000.0) as usize + 1;
        let [columns, rows] = params.extent().map(points);
        let mut field = HeightField { columns, rows, cell, counts: vec![0; rows * columns] };
        for row in 0..rows {
            for column in 0..columns {
                let [x, y] = field.point(row, column);
                field.counts[row * columns + column] = (height(x, y) / HEIGHT_QUANTUM).round() as i32;
            }
        }
        field
    }

    fn point(&self, row: usize, column: usize) -> [f64; 2] {
        let [half_x, half_y] = self.half_size();
        [column as f64 * self.cell - half_x, row as f64 * self.cell - half_y]
    }

    /// Height of the triangle at a point, m; `None` outside the field. The diagonal of a cell runs along +x +y, as in MuJoCo.
    fn height_at(&self, x: f64, y: f64) -> Option<f64> {
        let [half_x, half_y] = self.half_size();
        let [u, v] = [(x + half_x) / self.cell, (y + half_y) / self.cell];
        let inside = u >= 0.0 && v >= 0.0 && u <= (self.columns - 1) as f64 && v <= (self.rows - 1) as f64;
        if !inside {
            return None;
        }
        let column = (u as usize).min(self.columns - 2);
        let row = (v as usize).min(self.rows - 2);
        let [u, v] = [u - column as f64, v - row as f64];
        let corner = |dr: usize, dc: usize| f64::from(self.counts[(row + dr) * self.columns + column + dc]);
        let (near, far) = (corner(0, 0), corner(1, 1));
        let height = if u > v {
            let side = corner(0, 1);
            near + u * (side - near) + v * (far - side)
        } else {
            let side = corner(1, 0);
            near + v * (side - near) + u * (far - side)
        };
        Some(height * HEIGHT_QUANTUM)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terrain(kind: TerrainKind, seed: i64) -> Terrain {
        let params = TerrainParams::of_kind(kind);
        assert!(params.check().is_ok());
        Terrain::new(&params, seed)
    }

    #[test]
    fn a_seed_determines_the_ground() {
        assert_eq!(terrain(TerrainKind::Rough, 1), terrain(TerrainKind::Rough, 1));
        assert_ne!(terrain(TerrainKind::Rough, 1), terrain(TerrainKind::Rough, 2));
    }

    #[test]
    fn rough_ground_has_stones_of_the_given_heights_and_a_flat_start() {
        for seed in 0..5 {
            let terrain = terrain(TerrainKind::Rough, seed);
            let field = terrain.field().unwrap();
            let highest = f64::from(field.max_count()) * HEIGHT_QUANTUM;
            let lowest = f64::from(field.min_count()) * HEIGHT_QUANTUM;
            assert!((0.035..0.05).contains(&highest), "seed {seed}: highest point {highest}");
            assert!((-0.01..-0.005).contains(&lowest), "seed {seed}: lowest point {lowest}");
            for (x, y) in [(0.0, 0.0), (0.5, 0.5), (-0.37, 0.32), (0.0, -0.75)] {
                assert_eq!(terrain.height_at(x, y), 0.0, "seed {seed} at {x} {y}");
            }
        }
    }

    #[test]
    fn the_sides_of_stones_are_not_steeper_than_the_limit() {
        let field = terrain(TerrainKind::Rough, 4).field.unwrap();
        let mut steepest: f64 = 0.0;
        for row in 0..field.rows - 1 {
            for column in 0..field.columns - 1 {
                let at = |dr: usize, dc: usize| f64::from(field.counts[(row + dr) * field.columns + column + dc]);
                let [rise_x, rise_y] =
                    [at(0, 1) - at(0, 0), at(1, 0) - at(0, 0)].map(|d| d * HEIGHT_QUANTUM / field.cell);
                steepest = steepest.max(libm::hypot(rise_x, rise_y));
            }
        }
        // 0.6 for a stone, plus 6 waves of 1/600 m amplitude and at least 0.6 m length; two stones can meet in one cell.
        assert!((0.4..0.6 * std::f64::consts::SQRT_2 + 0.11).contains(&steepest), "steepest {steepest}");
    }

    #[test]
    fn stairs_and_ramps_rise_along_x() {
        let stairs = terrain(TerrainKind::Steps, 0);
        for (x, expected) in [(0.5, 0.0), (1.0, 0.05), (1.5, 0.10), (5.0, 0.45)] {
            assert!((stairs.height_at(x, 0.3) - expected).abs() <= HEIGHT_QUANTUM, "stairs at {x}");
        }
        let ramp = terrain(TerrainKind::Slope, 0);
        assert!((ramp.height_at(2.8, -1.0) - 2.0 * 0.17f64.tan()).abs() < 2.0 * HEIGHT_QUANTUM);
        assert_eq!(ramp.height_at(-3.0, 1.0), 0.0);
    }

    #[test]
    fn the_plane_around_the_field_is_lower_than_the_field() {
        let terrain = terrain(TerrainKind::Rough, 1);
        assert_eq!(terrain.height_at(6.5, 0.0), terrain.plane_height());
        assert!(terrain.plane_height() <= f64::from(terrain.field().unwrap().min_count()) * HEIGHT_QUANTUM - 0.01);
        assert_eq!(self::terrain(TerrainKind::Flat, 1).height_at(99.0, 0.0), 0.0);
    }

    #[test]
    fn a_key_of_another_kind_is_an_error() {
        let params = TerrainParams { step_height_m: Some(0.1), ..TerrainParams::of_kind(TerrainKind::Rough) };
        let bad = params.check().unwrap_err();
        assert_eq!((bad.key, bad.found.as_str()), ("step_height_m", "given"));
        let params = TerrainParams { cell_m: Some(f64::NAN), ..TerrainParams::of_kind(TerrainKind::Rough) };
        assert_eq!(params.check().unwrap_err().key, "cell_m");
    }
}
