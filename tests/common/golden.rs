//! Reads the golden cases: scenes with their pictures and gradients by other implementations of the formulas in double
//! precision. One is shipped (`assets/golden`, made by `tools/golden.py`); the others lie beside the repository.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ivv::internals::reference::Params;
use ivv::internals::scene::{Motion, Splats, View};
pub use ivv_conformance::adjoint::group;

/// The golden cases; the first is shipped.
pub const CASES: [&str; 5] = ["room", "static-small", "dynamic-small", "dynamic-offcentre", "occluders"];

/// Tensors by name, flat and row-major, in double precision.
pub type Tensors = BTreeMap<String, Vec<f64>>;

pub struct Golden {
    pub splats: Splats,
    pub params: Params<f64>,
    pub view: View,
    pub outputs: Tensors,
    pub cotangents: Tensors,
    pub gradients: Tensors,
}

/// The folder of a case. None, and a skip is noted, where it is one of those beside the repository and absent.
#[track_caller]
pub fn folder(case: &str) -> Option<PathBuf> {
    if case == CASES[0] {
        return Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/golden").join(case));
    }
    super::notes::shared(&format!("golden/{case}"))
}

/// Reads a case. None, and a skip is noted, where its folder is absent.
#[track_caller]
pub fn load(case: &str) -> Option<Golden> {
    let folder = folder(case)?;
    let (view, background) = read_view(&folder.join("camera.json"));
    let splats = read_splats(&folder.join("scene.ply"));
    // The view's colour is f32; the golden program read the decimals of the file.
    let params = Params { background, ..Params::new(&splats, &view) };
    Some(Golden {
        splats,
        params,
        view,
        outputs: read_tensors(&folder.join("outputs.safetensors")),
        cotangents: read_tensors(&folder.join("cotangents.safetensors")),
        gradients: read_tensors(&folder.join("gradients.safetensors")),
    })
}

fn read_view(file: &Path) -> (View, [f64; 3]) {
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let first = &json["views"][0];
    let view = serde_json::from_value(first.clone()).unwrap();
    (view, std::array::from_fn(|k| first["background"][k].as_f64().unwrap()))
}

fn read_tensors(file: &Path) -> Tensors {
    let bytes = std::fs::read(file).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let values = |tensor: &safetensors::tensor::TensorView| -> Vec<f64> {
        match tensor.dtype() {
            safetensors::Dtype::F32 => {
                tensor.data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()).into()).collect()
            }
            safetensors::Dtype::F64 => {
                tensor.data().chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
            }
            other => panic!("{}: unexpected type {other:?}", file.display()),
        }
    };
    tensors.iter().map(|(name, tensor)| (name.to_owned(), values(&tensor))).collect()
}

/// A 3DGS PLY whose properties are all little-endian floats. Where the file has velocities, those Gaussians are static that
/// come before the first with a finite `t_scale`.
fn read_splats(file: &Path) -> Splats {
    let bytes = std::fs::read(file).unwrap();
    let end = b"end_header\n";
    let body = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..body]).unwrap();
    let n: usize = header.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    let names: Vec<&str> = header.lines().filter_map(|l| l.strip_prefix("property float ")).collect();
    let floats: Vec<f32> = bytes[body..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(floats.len(), n * names.len());

    let at = |row: usize, name: &str| {
        let column = names.iter().position(|x| *x == name).unwrap_or_else(|| panic!("no property {name}"));
        floats[row * names.len() + column]
    };
    let n_rest = names.iter().filter(|x| x.starts_with("f_rest_")).count() / 3;
    let has_motion = names.contains(&"velocity_0");
    let mut splats = Splats {
        n_static: (0..n).find(|row| has_motion && at(*row, "t_scale").is_finite()).unwrap_or(n),
        sh_degree: (n_rest + 1).isqrt() as u32 - 1,
        ..Splats::default()
    };
    for i in 0..n {
        let group = |name: &str, k: usize| at(i, &format!("{name}_{k}"));
        splats.position.push([at(i, "x"), at(i, "y"), at(i, "z")]);
        splats.rotation.push(std::array::from_fn(|k| group("rot", k)));
        splats.scale.push(std::array::from_fn(|k| group("scale", k)));
        splats.opacity.push(at(i, "opacity"));
        splats.sh.push(std::array::from_fn(|k| group("f_dc", k)));
        for k in 0..n_rest {
            splats.sh.push(std::array::from_fn(|channel| group("f_rest", channel * n_rest + k)));
        }
        if i >= splats.n_static {
            splats.motion.push(Motion {
                velocity: std::array::from_fn(|k| group("velocity", k)),
                t_center: at(i, "t_center"),
                t_scale: at(i, "t_scale"),
            });
        }
        splats.source_row.push(i as u32);
    }
    splats
}
