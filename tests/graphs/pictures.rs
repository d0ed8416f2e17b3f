//! The pictures in the documents are those that their graphs draw.

use warploom_core::engine::{Engine, Job, Settings};

use super::root;

#[test]
fn pictures_of_warps_are_drawn_by_their_graph_and_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let plan = super::determinism::plan(&root().join("graphs/warps/pictures.ron"), folder.path());
    let report = Engine::new(Settings { threads: 2, ..Settings::default() }).run(&plan, &Job::default());
    assert!(report.faults.is_empty(), "{:#?}", report.faults);
    let document = std::fs::read_to_string(root().join("core/docs/warps.md")).expect("readable");
    for output in &report.outputs {
        let name = output.path.file_name().expect("a file").to_string_lossy();
        let kept = std::fs::read(root().join("core/docs/pictures").join(&*name)).expect("readable");
        let drawn = std::fs::read(&output.path).expect("it is written");
        assert!(kept == drawn, "core/docs/pictures/{name} is not what graphs/warps/pictures.ron draws");
        assert!(document.contains(&format!("](pictures/{name})")), "core/docs/warps.md shows {name}");
    }
    let kept = std::fs::read_dir(root().join("core/docs/pictures")).expect("a folder").count();
    assert_eq!(kept, report.outputs.len(), "every picture has a sink");
}
