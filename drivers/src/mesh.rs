//! Bounding boxes of mesh files that a URDF names: STL, OBJ, and COLLADA files with one geometry.

use nalgebra::{Matrix4, Point3, Vector3};
use robot_model::{Bounds, bounds_of};
use std::path::{Path, PathBuf};

/// Largest size of a mesh file, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The bounding box of a mesh, in its own frame, m; `None` if the file is missing, too large, or of another kind.
///
/// - `name`: file name in the URDF: `package://…`, `file://…`, absolute, or relative to the URDF.
/// - `urdf`: path of the URDF. A package is looked for in the folders above it.
pub fn bounds(name: &str, urdf: &Path) -> Option<Bounds> {
    let path = find(name, urdf)?;
    let kind = path.extension()?.to_str()?.to_lowercase();
    let meta = std::fs::metadata(&path).ok()?;
    if !meta.is_file() || meta.len() > MAX_BYTES {
        return None;
    }
    let bytes = std::fs::read(&path).ok()?;
    let bounds = match kind.as_str() {
        "stl" => stl(&bytes),
        "obj" => text_points(&String::from_utf8_lossy(&bytes), "v"),
        "dae" => collada(&String::from_utf8_lossy(&bytes)),
        _ => None,
    }?;
    bounds.iter().all(|corner| corner.iter().all(|x| x.is_finite() && x.abs() < 1e6)).then_some(bounds)
}

fn find(name: &str, urdf: &Path) -> Option<PathBuf> {
    // The parent of a plain file name is an empty path, which has no ancestors.
    let urdf = std::path::absolute(urdf).ok()?;
    let folder = urdf.parent()?;
    if let Some(rest) = name.strip_prefix("package://") {
        let inside = rest.split_once('/').map(|(_, inside)| inside)?;
        return folder.ancestors().flat_map(|above| [above.join(rest), above.join(inside)]).find(|path| path.is_file());
    }
    Some(folder.join(name.strip_prefix("file://").unwrap_or(name)))
}

fn stl(bytes: &[u8]) -> Option<Bounds> {
    let count = bytes.get(80..84).and_then(|n| n.try_into().ok()).map_or(0, u32::from_le_bytes) as usize;
    if bytes.len() != 84 + 50 * count || count == 0 {
        return text_points(&String::from_utf8_lossy(bytes), "vertex");
    }
    let number = |at: &[u8]| at.try_into().map_or(f64::NAN, |four| f64::from(f32::from_le_bytes(four)));
    // A triangle: its normal, three corners, two bytes.
    bounds_of(bytes[84..].chunks_exact(50).flat_map(|triangle| {
        triangle[12..48]
            .chunks_exact(12)
            .map(move |p| Vector3::new(number(&p[..4]), number(&p[4..8]), number(&p[8..12])))
    }))
}

/// The box around the points of lines `KEY x y z`.
fn text_points(text: &str, key: &str) -> Option<Bounds> {
    bounds_of(text.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        if words.next() != Some(key) {
            return None;
        }
        let mut number = || words.next()?.parse::<f64>().ok();
        Some(Vector3::new(number()?, number()?, number()?))
    }))
}

/// A file with one geometry, under at most one matrix; the transforms of several nodes are not read.
fn collada(text: &str) -> Option<Bounds> {
    if text.matches("<instance_geometry").count() != 1 || text.matches("<matrix").count() > 1 {
        return None;
    }
    if ["<translate", "<rotate", "<scale"].iter().any(|tag| text.contains(tag)) {
        return None;
    }
    let numbers = |text: &str| text.split_whitespace().map_while(|word| word.parse::<f64>().ok()).collect::<Vec<_>>();
    let inside =
        |text: &str| numbers(text.split_once('>').map_or("", |(_, rest)| rest.split('<').next().unwrap_or("")));
    // The array of positions has `position` in its id.
    let arrays = text.split("<float_array").skip(1);
    let positions =
        arrays.filter(|array| array.split('>').next().is_some_and(|tag| tag.to_lowercase().contains("position")));
    let values: Vec<f64> = positions.flat_map(inside).collect();
    let matrix = match text.split("<matrix").nth(1).map(inside) {
        None => Matrix4::identity(),
        Some(values) if values.len() == 16 => Matrix4::from_row_slice(&values),
        Some(_) => return None,
    };
    let unit =
        text.split("meter=\"").nth(1).and_then(|rest| rest.split('"').next()?.parse::<f64>().ok()).unwrap_or(1.0);
    let is_y_up = text.contains("Y_UP");
    let upright = |p: Vector3<f64>| if is_y_up { Vector3::new(p.x, -p.z, p.y) } else { p };
    bounds_of(values.chunks_exact(3).map(|p| {
        let p = matrix.transform_point(&Point3::new(p[0], p[1], p[2])).coords;
        upright(p) * unit
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, content: &[u8]) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("hoof_mesh_{}", std::process::id())).join("pkg/meshes");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(name), content).unwrap();
        folder.parent().unwrap().join("urdf/robot.urdf")
    }

    #[test]
    fn boxes_of_each_kind_of_file() {
        let mut stl = vec![0; 80];
        stl.extend(1_u32.to_le_bytes());
        for x in [0.0_f32, 0.0, 1.0, -1.0, 2.0, 0.5, 3.0, -4.0, 0.0, 1.0, 1.0, 7.0] {
            stl.extend(x.to_le_bytes());
        }
        stl.extend([0, 0]);
        let expected = Some([Vector3::new(-1.0, -4.0, 0.0), Vector3::new(3.0, 2.0, 7.0)]);
        let urdf = file("a.stl", &stl);
        assert_eq!(bounds("package://pkg/meshes/a.stl", &urdf), expected);
        assert_eq!(bounds("../meshes/a.stl", &urdf), None, "the folder of the URDF does not exist");
        std::fs::create_dir_all(urdf.parent().unwrap()).unwrap();
        assert_eq!(bounds("../meshes/a.stl", &urdf), expected);
        file("b.STL", b"solid b\nfacet\nvertex -1 2 0.5\nvertex 3 -4 0\n vertex 1 1 7\n");
        assert_eq!(bounds("package://pkg/meshes/b.STL", &urdf), expected);
        file("c.obj", b"# v 9 9 9\nv -1 2 0.5\nvn 9 9 9\nv 3 -4 0\nv 1 1 7\nf 1 2 3\n");
        assert_eq!(bounds("package://pkg/meshes/c.obj", &urdf), expected);
        let dae = "<unit meter=\"0.5\"/><up_axis>Z_UP</up_axis><float_array id=\"m-positions-array\" count=\"9\">-1 2 0.5 3 -4 0 1 1 7</float_array>\
            <float_array id=\"m-normals-array\">99 99 99</float_array><matrix sid=\"transform\">2 0 0 0 0 2 0 0 0 0 2 2 0 0 0 1</matrix><instance_geometry/>";
        file("d.dae", dae.as_bytes());
        let moved = expected.map(|corners| corners.map(|corner| corner + Vector3::z()));
        assert_eq!(bounds("package://pkg/meshes/d.dae", &urdf), moved);
        file("y_up.dae", dae.replace("Z_UP", "Y_UP").as_bytes());
        let turned = Some([Vector3::new(-1.0, -8.0, -4.0), Vector3::new(3.0, -1.0, 2.0)]);
        assert_eq!(bounds("package://pkg/meshes/y_up.dae", &urdf), turned);
        file("e.dae", dae.replace("<instance_geometry/>", "<instance_geometry/><instance_geometry/>").as_bytes());
        for name in ["e.dae", "missing.stl", "f.ply"] {
            assert_eq!(bounds(&format!("package://pkg/meshes/{name}"), &urdf), None, "{name}");
        }
        std::fs::remove_dir_all(urdf.ancestors().nth(2).unwrap().parent().unwrap()).unwrap();
    }

    /// A URDF given by its name alone is in the working directory, here that of the crate.
    #[test]
    fn a_package_is_found_above_a_urdf_without_folder() {
        let found = find("package://any/Cargo.toml", Path::new("robot.urdf")).unwrap();
        assert_eq!(found, Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"));
    }
}
