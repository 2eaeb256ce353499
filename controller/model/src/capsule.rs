//! Capsules around the shapes of links, and the closest points of two segments.

use nalgebra::Vector3;

use super::bodies::{FrameId, Model};
use super::error::ModelError;
use super::tree::{Shape, ShapeKind, UrdfTree};

/// All points within a distance of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Ends of the segment, m.
    pub ends: [Vector3<f64>; 2],
    /// Distance, m.
    pub radius: f64,
}

impl Capsule {
    /// A capsule that contains a shape, in the axes of the shape's link; `None` for a mesh.
    ///
    /// Sphere and capsule: the shape itself. Cylinder: the same axis and radius, so it is longer by the radius at each end. Box: the axis along the longest
    /// edge, the radius half the diagonal of the other two.
    pub fn around(shape: &Shape) -> Option<Self> {
        let along = |axis: usize, half: f64| {
            let mut end = Vector3::zeros();
            end[axis] = half;
            [-end, end].map(|end| shape.X_LS.p + shape.X_LS.R * end)
        };
        let (ends, radius) = match shape.kind {
            ShapeKind::Sphere { radius } => ([shape.X_LS.p; 2], radius),
            ShapeKind::Cylinder { radius, length } | ShapeKind::Capsule { radius, length } => {
                (along(2, 0.5 * length), radius)
            }
            ShapeKind::Box { size } => {
                let mut longest = 0;
                for k in 1..3 {
                    if size[k] > size[longest] {
                        longest = k;
                    }
                }
                let (b, c) = (size[(longest + 1) % 3], size[(longest + 2) % 3]);
                (along(longest, 0.5 * size[longest]), 0.5 * (b * b + c * c).sqrt())
            }
            ShapeKind::Mesh { .. } => return None,
        };
        Some(Capsule { ends, radius })
    }
}

/// Capsules around the primitive shapes of all links, each in the axes of its link. A link without primitive collision shapes collides with its visual ones.
///
/// # Errors
/// [`ModelError::Unknown`] if the model was made from another URDF.
pub fn capsules(tree: &UrdfTree, model: &Model) -> Result<Vec<(FrameId, Capsule)>, ModelError> {
    let mut found = Vec::new();
    for link in &tree.links {
        let frame = model.frame(&link.name)?;
        let around = |shapes: &[Shape]| shapes.iter().filter_map(Capsule::around).collect::<Vec<_>>();
        let collisions = around(&link.collisions);
        let of_link = if collisions.is_empty() { around(&link.visuals) } else { collisions };
        found.extend(of_link.into_iter().map(|capsule| (frame, capsule)));
    }
    Ok(found)
}

/// The points of the segments `a` and `b` with the smallest distance, the first on `a`; one such pair if the segments are parallel. A segment may be a point.
///
/// The squared distance is convex in the two parameters, so its minimum over the unit square is the stationary point, if that lies inside, or on an edge of the square,
/// where one point is an end of its segment. All five are compared, so nearly parallel segments need no threshold.
#[must_use]
pub fn closest_points(a: &[Vector3<f64>; 2], b: &[Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
    let mut best = ([a[0], b[0]], f64::INFINITY);
    let mut consider = |points: [Vector3<f64>; 2]| {
        let distance = (points[1] - points[0]).norm_squared();
        if distance < best.1 {
            best = (points, distance);
        }
    };
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let determinant = uu * vv - uv * uv;
    if determinant > 0.0 {
        let s = (uv * v.dot(&w) - vv * u.dot(&w)) / determinant;
        let t = (uu * v.dot(&w) - uv * u.dot(&w)) / determinant;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            consider([a[0] + u * s, b[0] + v * t]);
        }
    }
    for end in a {
        consider([*end, nearest_on(b, end)]);
    }
    for end in b {
        consider([nearest_on(a, end), *end]);
    }
    best.0
}

/// The point of a segment that is nearest to `p`.
fn nearest_on(segment: &[Vector3<f64>; 2], p: &Vector3<f64>) -> Vector3<f64> {
    let u = segment[1] - segment[0];
    let length = u.dot(&u);
    let along = if length > 0.0 { (p - segment[0]).dot(&u) / length } else { 0.0 };
    segment[0] + u * along.clamp(0.0, 1.0)
}
