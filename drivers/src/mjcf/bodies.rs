//! Links grouped into the bodies of the simulator, with their inertias.

use nalgebra::{Matrix3, Vector3};
use robot_model::{LinkGroups, Pose, UrdfTree};

/// Mass of a moving body without mass (a helper link), kg; MuJoCo rejects zero.
const PLACEHOLDER_MASS: f64 = 1e-6;
/// Its principal moments of inertia, kg m².
const PLACEHOLDER_INERTIA: f64 = 1e-9;

/// Links grouped into bodies. The frame of a body is that of its first link.
pub(super) struct Bodies {
    pub groups: LinkGroups,
    pub list: Vec<Body>,
}

/// The inertia of a body, and the bodies that hang on it.
pub(super) struct Body {
    /// Links of the body, in the order of the tree.
    pub links: Vec<usize>,
    pub children: Vec<usize>,
    mass: f64,
    /// First moment of mass about the origin of the body, kg m.
    moment: Vector3<f64>,
    /// Inertia about the origin of the body, kg m².
    inertia: Matrix3<f64>,
}

impl Bodies {
    pub fn new(tree: &UrdfTree) -> Self {
        let groups = LinkGroups::new(tree, |_| Matrix3::identity());
        let empty = || Body {
            links: Vec::new(),
            children: Vec::new(),
            mass: 0.0,
            moment: Vector3::zeros(),
            inertia: Matrix3::zeros(),
        };
        let mut list: Vec<Body> = groups.first_links.iter().map(|_| empty()).collect();
        for (body, &first_link) in groups.first_links.iter().enumerate() {
            if let Some(joint) = tree.links[first_link].parent_joint {
                list[groups.body_of_link[tree.joints[joint].parent]].children.push(body);
            }
        }
        for (i, (link, (&body, X_BL))) in
            tree.links.iter().zip(groups.body_of_link.iter().zip(&groups.X_BL)).enumerate()
        {
            list[body].links.push(i);
            list[body].add(&X_BL.then(&link.inertial.X_LC), link.inertial.mass, &link.inertial.I_C);
        }
        Bodies { groups, list }
    }
}

impl Body {
    /// Mass, centre of mass in the body, and inertia about it; small placeholders for a body without mass.
    pub fn inertial(&self) -> (f64, Vector3<f64>, Matrix3<f64>) {
        if self.mass > PLACEHOLDER_MASS {
            let c = self.moment / self.mass;
            (self.mass, c, balanced(self.inertia - steiner(self.mass, &c)))
        } else {
            (PLACEHOLDER_MASS, Vector3::zeros(), Matrix3::identity() * PLACEHOLDER_INERTIA)
        }
    }

    /// Adds a mass whose centre and inertia axes are at `X_BC`. The formulas differ from those of [`robot_model::Model`] in
    /// their rounding; they stay as they are, because a changed bit of an inertia changes every simulated run.
    fn add(&mut self, X_BC: &Pose, mass: f64, I_C: &Matrix3<f64>) {
        self.mass += mass;
        self.moment += mass * X_BC.p;
        self.inertia += X_BC.R * I_C * X_BC.R.transpose() + steiner(mass, &X_BC.p);
    }
}

/// Inertia about the origin of a point mass at `p`, kg m².
fn steiner(mass: f64, p: &Vector3<f64>) -> Matrix3<f64> {
    mass * (Matrix3::identity() * p.dot(p) - p * p.transpose())
}

/// The inertia itself; if no mass distribution has it, that of a sphere with the same mean moment. MuJoCo rejects such an inertia, and
/// [`robot_model::ModelWarning`] reports it.
fn balanced(I: Matrix3<f64>) -> Matrix3<f64> {
    let mut moments: [f64; 3] = I.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    // MuJoCo's own tolerance is absolute: 1e-15 kg m².
    if moments[0] > 0.0 && moments[0] + moments[1] >= moments[2] - 1e-15 {
        return I;
    }
    Matrix3::identity() * (I.trace() / 3.0).max(PLACEHOLDER_INERTIA)
}
