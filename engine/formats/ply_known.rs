//! Which properties of a PLY change the picture: by the names that known methods write, or else by the words of a name.

use super::scene::compensated;
use crate::error::{Error, Result};
use crate::files::ply_header::{Element, Header};
use std::collections::BTreeMap;
use std::path::Path;

/// Properties that are in so many files that a note would only disturb.
const SILENT: [&str; 10] = ["nx", "ny", "nz", "nxx", "red", "green", "blue", "alpha", "normal_x", "normal_y"];

/// Files with properties of their own.
struct Method {
    /// Without numbers; any of them identifies the method.
    names: &'static str,
    what: &'static str,
    remedy: &'static str,
}

const ONE_MOMENT: &str = "export one moment of it as a plain 3DGS PLY with the program that trained it";
const PLAIN: &str = "export it as a plain 3DGS PLY with the program that trained it";
const METHODS: [Method; 7] = [
    Method {
        // Colours of more than three numbers.
        names: "f_t f_dc",
        what: "go through a network that makes the colours (the full model of Spacetime Gaussians)",
        remedy: "train it as ours_lite, whose PLY is read where motion is along lines",
    },
    Method {
        names: "xyz_disp motion_xyz motion_rot opacity_c opacity_v motion_opacity_c motion_opacity_v",
        what: "move and fade Gaussians between key frames (Ex4DGS)",
        remedy: ONE_MOMENT,
    },
    Method {
        names: "t scale_t rot_r",
        what: "make the Gaussians four-dimensional (4D Gaussian Splatting)",
        remedy: ONE_MOMENT,
    },
    Method {
        names: "f_offset f_anchor_feat f_kernel_feat",
        what: "are of anchors, from which networks make the Gaussians (Scaffold-GS and its kin)",
        remedy: "export the Gaussians that the networks make as a 3DGS PLY, or train with a method without networks",
    },
    Method {
        names: "binding",
        what: "tie the Gaussians to a mesh that moves (GaussianAvatars)",
        remedy: "export one pose of it as a plain 3DGS PLY with the program that trained it",
    },
    Method {
        names: "beta sb_params sb",
        what: "give each splat a shape that is no Gaussian (Beta Splatting)",
        remedy: PLAIN,
    },
    Method {
        names: "asg f_asg roughness metallic metalness albedo base_color refl_strength specular",
        what: "are materials, from which a renderer with lights makes the colours",
        remedy: PLAIN,
    },
];

/// Words of properties that label, count or measure: they change no picture, whatever else the name says.
const HARMLESS: &str = "label labels id ids index idx instance instances ins semantic semantics sem seg segment segments segmentation \
    class classes cluster clusters category object objects obj group groups language lang clip dino sam mask masks score scores \
    confidence conf uncertainty certainty error errors importance contribution count counts visits lod level levels normal normals \
    depth thermal selected deleted flags state radius radii radii2 grad denom camera cameras cam source";
/// Words of properties that move Gaussians, or say when they exist.
const MOTION: &str = "t dt time times timestamp timestep tp trbf tcen motion motions move movement velocity vel omega zeta disp \
    displacement deform deformation deformations flow traj trajectory poly polynomial fourier control knot knots spline keyframe \
    keyframes delta dx dy dz dxyz dpos drot acc accel acceleration jerk angular duration lifetime lifespan life birth death dynamic \
    dynamics temporal warp hexplane offset offsets lbs bone bones skin skinning joint joints blendshape bary barycentric";
/// Words of properties that have a part in colour, opacity or shape.
const LOOKS: &str = "f feat feats feature features fea anchor latent latents embedding embeddings emb code asg sg kernel gamma skew \
    shape albedo diffuse specular roughness metallic metalness refl reflect reflectance reflection fresnel brdf bsdf ind indirect \
    incident incidents scatter scatters visibility transmittance env envmap light lighting irradiance radiance color colour \
    colors rgb tint texture tex uv sh shs opacity opacities alphas scale scales scaling rot rotation quat dc rest mlp hash \
    appearance exposure sky filter";

/// The notes on a PLY whose reader takes the elements `read` and the properties for which `is_read` holds. Refuses any other
/// that changes the picture.
pub(super) fn judge(
    path: &Path,
    header: &Header,
    vertex: &Element,
    read: &[&str],
    is_read: impl Fn(&str) -> bool,
) -> Result<Vec<String>> {
    let mut unread: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for property in vertex.properties.iter().filter(|property| !is_read(&property.name)) {
        let stem = stem(&property.name);
        if !SILENT.contains(&stem) && !SILENT.contains(&property.name.as_str()) {
            unread.entry(stem).or_default().push(&property.name);
        }
    }
    let refuse = |is_its: &dyn Fn(&str) -> bool, what: &str, remedy: &str| {
        let own = || unread.iter().filter(|(stem, _)| is_its(stem));
        let Some(first) = own().next().and_then(|(_, names)| names.first()) else { return Ok(()) };
        let place = format!("element `vertex`, property `{}`", first.escape_debug());
        Err(Error::data(path, place, format!("{} {what}, and ivv does not read them", list(own())), remedy))
    };
    for method in &METHODS {
        refuse(&|stem| method.names.split(' ').any(|name| name == stem), method.what, method.remedy)?;
    }
    let says = |stem: &str, words: &str| !has_word(stem, HARMLESS) && has_word(stem, words);
    let what = "move Gaussians, or say when they are there, by the words of their names";
    refuse(&|stem| says(stem, MOTION), what, ONE_MOMENT)?;
    let what = "have a part in colour, opacity or shape, by the words of their names";
    refuse(&|stem| says(stem, LOOKS), what, PLAIN)?;
    let mut notes = Vec::new();
    if !unread.is_empty() {
        let n: usize = unread.values().map(Vec::len).sum();
        let are = if n == 1 { "property of its Gaussians is" } else { "properties of its Gaussians are" };
        notes.push(format!("{n} {are} not read: {}", list(unread.iter())));
    }
    notes.extend(elements(path, header, read)?);
    Ok(notes)
}

/// The note on elements beside the Gaussians' own.
fn elements(path: &Path, header: &Header, read: &[&str]) -> Result<Option<String>> {
    let mut names = Vec::new();
    let is_read = |element: &Element| read.contains(&element.name.as_str());
    for element in header.elements.iter().filter(|element| !is_read(element) && element.count > 0) {
        let stem = stem(&element.name);
        let name = element.name.escape_debug();
        if !has_word(stem, HARMLESS) && has_word(stem, MOTION) {
            let reason = "moves Gaussians, by the words of its name, and ivv does not read it";
            return Err(Error::data(path, format!("element `{name}`"), reason, ONE_MOMENT));
        }
        names.push(format!("`{name}`"));
    }
    let verb = if names.len() == 1 { "element beside `vertex` is" } else { "elements beside `vertex` are" };
    Ok((!names.is_empty()).then(|| format!("{} {verb} not read: {}", names.len(), names.join(", "))))
}

/// "`f_t_*` (3), `beta`".
fn list<'a>(groups: impl Iterator<Item = (&'a &'a str, &'a Vec<&'a str>)>) -> String {
    let told = groups.map(|(stem, names)| match &names[..] {
        [name] => format!("`{}`", name.escape_debug()),
        names => format!("`{}_*` ({})", stem.escape_debug(), names.len()),
    });
    told.collect::<Vec<_>>().join(", ")
}

/// `motion_xyz_0_1` is `motion_xyz`.
pub(super) fn stem(name: &str) -> &str {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    if stem.is_empty() { name } else { stem }
}

/// True if a word of `name`, without its number, is among `words`.
fn has_word(name: &str, words: &str) -> bool {
    let mut own = name.split(|c: char| !c.is_ascii_alphanumeric());
    own.any(|word| {
        let word = word.trim_end_matches(|c: char| c.is_ascii_digit()).to_ascii_lowercase();
        !word.is_empty() && words.split_ascii_whitespace().any(|known| known == word)
    })
}

/// The last comment wins: Brush's `SplatRenderMode: mip`, Postshot's `antialiased 1`.
pub(super) fn compensation(header: &Header) -> Option<String> {
    let said = header.comments.iter().rev().find_map(|line| {
        let words = line.to_ascii_lowercase();
        let mode = words.strip_prefix("splatrendermode:").map(|mode| mode.trim() == "mip");
        mode.or_else(|| words.strip_prefix("antialiased ").map(|flag| flag.trim() == "1")).map(|is| (is, line))
    });
    let (is_compensated, line) = said?;
    is_compensated.then(|| compensated(&format!("comment `{line}`")))
}

/// 4DGaussians and Deformable 3D Gaussians save a network that moves the Gaussians beside the file.
pub(super) fn network_beside(path: &Path) -> Option<String> {
    let folder = path.parent()?;
    let is_iteration = folder.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"iteration_"));
    let of_deformable = folder.parent().and_then(Path::parent).map(|model| model.join("deform"));
    let known = [Some(folder.join("deformation.pth")), of_deformable.filter(|_| is_iteration)];
    let network = known.into_iter().flatten().find(|network| network.exists())?;
    Some(format!(
        "its Gaussians are moved by a network, {}, which is not read: they are shown as they are before that; to see a moment as it \
         is, {ONE_MOMENT} (4DGaussians: export_perframe_3DGS.py)",
        network.display()
    ))
}
