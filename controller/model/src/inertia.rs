//! Spatial inertia of a rigid body.

use std::ops::AddAssign;

use nalgebra::{Matrix3, Vector3};

/// Mass, first and second moments of mass about the origin of a frame, in the axes of that frame.
///
/// The inertia of two bodies in the same frame is the sum of their components.
/// Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), §2.13.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpatialInertia {
    /// Mass, kg.
    pub(super) m: f64,
    /// Mass times position of the centre of mass, kg m.
    pub(super) mc: Vector3<f64>,
    /// Rotational inertia about the origin (not the centre of mass), kg m².
    pub(super) I_O: Matrix3<f64>,
}

impl SpatialInertia {
    pub(super) fn zero() -> Self {
        Self { m: 0.0, mc: Vector3::zeros(), I_O: Matrix3::zeros() }
    }

    /// Inertia from mass, centre of mass and rotational inertia about the centre of mass.
    #[inline]
    pub(super) fn from_com(m: f64, c: Vector3<f64>, I_C: &Matrix3<f64>) -> Self {
        Self { m, mc: m * c, I_O: I_C + point_inertia(m, &c) }
    }

    /// Centre of mass, and rotational inertia about it. Without mass, the centre of mass is the origin.
    pub(super) fn about_com(&self) -> (Vector3<f64>, Matrix3<f64>) {
        if self.m == 0.0 {
            return (Vector3::zeros(), self.I_O);
        }
        let c = self.mc / self.m;
        (c, self.I_O - point_inertia(self.m, &c))
    }

    /// Momentum `(p, l)` about the origin of a body with angular velocity `w` whose point at the origin has velocity `v`.
    #[inline]
    pub(super) fn momentum(&self, v: &Vector3<f64>, w: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        (self.m * v + w.cross(&self.mc), self.mc.cross(v) + self.I_O * w)
    }
}

impl AddAssign for SpatialInertia {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.m += other.m;
        self.mc += other.mc;
        self.I_O += other.I_O;
    }
}

/// Rotational inertia about the origin of a point mass at `c`: `m (c·c E - c cᵀ)`.
#[inline]
fn point_inertia(m: f64, c: &Vector3<f64>) -> Matrix3<f64> {
    let (x, y, z) = (c.x, c.y, c.z);
    let (xy, xz, yz) = (-m * (x * y), -m * (x * z), -m * (y * z));
    Matrix3::new(m * (y * y + z * z), xy, xz, xy, m * (x * x + z * z), yz, xz, yz, m * (x * x + y * y))
}
