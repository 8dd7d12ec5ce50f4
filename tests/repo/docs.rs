//! What documents tabulate is generated or compared.

use super::{files, marked, quoted, root, table, text};
use crate::common::prelude::*;
use crate::common::random;
use ivv::internals::gpu::table::FAMILIES;

const KERNEL_TABLE: &str = "shaders-glsl/README.md";

/// What follows `// Purpose` in a shader's header, up to its first full stop.
fn purpose(shader: &str) -> String {
    let source = text(&format!("shaders-glsl/{shader}"));
    let (_, rest) = source.split_once("// Purpose   ").unwrap_or_else(|| panic!("{shader}: no purpose"));
    let (purpose, _) = rest.split_once("\n// Equation").unwrap_or_else(|| panic!("{shader}: no equation"));
    purpose.replace("\n//", "").split_whitespace().collect::<Vec<_>>().join(" ").trim_end_matches('.').to_owned()
}

fn kernel_table() -> String {
    let mut lines = vec![
        "| kernels | shader | choices | purpose | reference | time grows with |".to_owned(),
        "| --- | --- | --- | --- | --- | --- |".to_owned(),
    ];
    for family in FAMILIES {
        let choices = family.axes.iter().map(|axis| {
            let values = axis.values.iter().map(|(name, _)| if name.is_empty() { "-" } else { name });
            format!("`{}`: {}", axis.name, values.collect::<Vec<_>>().join(", "))
        });
        let of = KERNELS.iter().filter(|row| row.family.name() == family.name() && !row.reference().is_empty());
        let mut references: Vec<String> = of.map(|row| format!("`{}`", row.reference())).collect();
        references.dedup();
        lines.push(format!(
            "| `{}{}` | `{}` | {} | {} | {} | {} |",
            family.name(),
            if family.axes.is_empty() { "" } else { "*" },
            family.file,
            choices.collect::<Vec<_>>().join("; "),
            purpose(family.file),
            references.join(", "),
            format!("{:?}", family.count).to_lowercase(),
        ));
    }
    lines.join("\n") + "\n"
}

#[test]
fn the_table_in_the_shaders_readme_is_the_table_of_kernels() {
    let document = text(KERNEL_TABLE);
    let ((before, written, after), generated) = (marked(&document, "kernels"), kernel_table());
    if written != generated {
        assert!(std::env::var_os("IVV_BLESS").is_some(), "mend it with: IVV_BLESS=1 cargo test --test it repo::docs");
        std::fs::write(root().join(KERNEL_TABLE), format!("{before}{generated}{after}")).unwrap();
    }
}

#[test]
fn the_frame_in_architecture_md_is_the_frame_that_runs() {
    let Some(gpu) = timed() else { return };
    let rows = table(&text("engine/ARCHITECTURE.md"), "frame");
    let told: Vec<String> = rows.iter().flat_map(|row| quoted(&row[0])).collect();
    let mut renderer = Renderer::new(gpu.clone(), &random::scene(5, 200, 1), Constants::default()).unwrap();
    let report = renderer.profile(&random::view(), Outputs::All).unwrap();
    let ran: Vec<&str> = report.passes.iter().map(|pass| pass.label.as_str()).collect();
    let same = |told: &String, ran: &&str| match told.strip_suffix('*') {
        Some(stem) => ran.starts_with(stem),
        None => told == ran,
    };
    let agree = told.len() == ran.len() && told.iter().zip(&ran).all(|(told, ran)| same(told, ran));
    assert!(!ran.is_empty() && agree, "told: {told:#?}\nran: {ran:#?}");
}

#[test]
fn the_passes_of_a_gradient_in_architecture_md_are_kernels() {
    let rows = table(&text("engine/ARCHITECTURE.md"), "gradient");
    assert!(!rows.is_empty());
    for told in rows.iter().flat_map(|row| quoted(&row[0])) {
        let is_told = |name: &str| told.strip_suffix('*').map_or(name == told, |stem| name.starts_with(stem));
        assert!(KERNELS.iter().any(|row| is_told(&row.name)), "`{told}` is no kernel");
    }
}

#[test]
fn tests_say_through_one_function_that_they_do_not_run() {
    let told = ["\"skip", "ped: "].concat();
    let by_variable = ["IVV_TEST", "_SLOW"].concat();
    let mut n_files = 0;
    for file in files("tests").into_iter().filter(|file| file.ends_with(".rs")) {
        let text = text(&file);
        n_files += 1;
        assert!(!text.contains(&told), "{file}: libtest hides what a test prints; call common::notes::skip");
        assert!(!text.contains(&by_variable), "{file}: a slow test is #[ignore = \"slow: why\"]");
    }
    assert!(n_files > 100, "only {n_files} files were read");
}

#[test]
fn bash_can_read_every_script() {
    let scripts = files("").into_iter().filter(|file| file.ends_with(".sh") || file == ".ci/run");
    let scripts: Vec<String> = scripts.collect();
    for named in ["tools/test.sh", "tests/mpi.sh", ".ci/run"] {
        assert!(scripts.iter().any(|script| script == named), "{named} was not read");
    }
    for script in scripts {
        let read = std::process::Command::new("bash").arg("-n").arg(root().join(&script)).output().unwrap();
        assert!(read.status.success(), "{script}: {}", String::from_utf8_lossy(&read.stderr));
    }
}

#[test]
fn the_shipped_demo_is_what_its_generator_makes() {
    let folder = Folder::new("demo");
    let (splats, views) = ivv::internals::scene::demo();
    ivv::internals::formats::write_ply(&folder.file("scene.ply"), &splats).unwrap();
    ivv::internals::scene::write_views(&folder.file("cameras.json"), &views).unwrap();
    for file in ["scene.ply", "cameras.json"] {
        let (made, shipped) =
            (std::fs::read(folder.file(file)).unwrap(), std::fs::read(root().join("assets/demo").join(file)).unwrap());
        assert!(!made.is_empty() && made == shipped, "{file}: mend it with: ivv debug demo -o assets/demo");
    }
}
