//! Pictures, and warps as pictures, in and out of files.

pub mod codec;
mod load;
mod load_warp;
mod save;
mod save_warp;
mod warp_file;
#[cfg(test)]
pub(crate) mod warp_tests;

pub use load::Load;
pub use load_warp::LoadWarp;
pub use save::Save;
pub use save_warp::SaveWarp;
pub use warp_file::{Centers, Channels, Choices, Meaning, Preset, Sign, Unit, YAxis};

#[cfg(test)]
mod tests {
    use warploom_core::registry::Registry;

    #[test]
    fn what_graph_files_may_say_of_them() {
        let registry = Registry::new(crate::NODES);
        let of = |name: &str| {
            let node = registry.get(name).expect("it is in the list");
            assert!(node.params.iter().all(|param| !param.doc.is_empty()), "{name} says what its parameters are for");
            let params = node.params.iter().map(|p| format!("{} {} {}", p.name, p.default, p.shape.describe(None)));
            (node.sink, node.outputs.len(), params.collect::<Vec<_>>())
        };
        let encoding = "encoding \"Auto\" one of `Auto`, `Linear`, `Srgb`, `Raw`";
        assert_eq!(of("Load"), (false, 1, vec!["path \"\" a path in double quotes".into(), encoding.into()]));
        let (sink, outputs, params) = of("Save");
        assert!(sink && outputs == 0 && params[0].ends_with("a node that gives Image") && params[2] == encoding);
        assert_eq!(params[3], "depth \"Auto\" one of `Auto`, `U8`, `U16`, `Half`, `Float`");
        assert!(params[4].starts_with("compression \"Auto\" one of `Auto`, `None`, `Rle`"));
        assert_eq!(params[5], "quality 90 a whole number from 1 to 100");
    }
}
