//! Every node type on every sort of picture: it gives what it declares, or says clearly why not.

use warploom_core::diag::{Code, Fault};
use warploom_core::node::OutputKind;
use warploom_core::value::{Image, Kind, Labels, Plane, Raster, Sample, Value};

use crate::given::Which;
use crate::stage::{Outcome, Stage, Subject, engine, node_types, sources};
use crate::texts;

/// Runs every subject on one thread and on three, compares, and looks at what comes out.
fn assert_all(subjects: impl Iterator<Item = Subject>) {
    let (stage, engines) = (Stage::new(), [engine(1), engine(3)]);
    let mut problems = Vec::new();
    for subject in subjects {
        let [outcome, other] = engines.each_ref().map(|engine| stage.run(engine, &subject));
        let problem = if outcome.bits() == other.bits() {
            outcome.report.faults.iter().find_map(unclear).or_else(|| unlike_declared(&subject, &outcome))
        } else {
            Some(format!("one thread: {:?}\nthree: {:?}", outcome.bits(), other.bits()))
        };
        problems.extend(problem.map(|problem| format!("{problem}\n{}", subject.graph())));
    }
    assert!(problems.is_empty(), "{} graphs:\n{}", problems.len(), problems[..problems.len().min(10)].join("\n\n"));
}

/// A fault that tells a person nothing, or that no person is to see.
fn unclear(fault: &Fault) -> Option<String> {
    let wrong = matches!(fault.code, Code::Panic | Code::Nondeterministic | Code::Cancelled);
    let vague = fault.message.len() < 10 || fault.node.is_none() || fault.place.is_none();
    (wrong || vague).then(|| format!("{fault:#?}"))
}

fn unlike_declared(subject: &Subject, outcome: &Outcome) -> Option<String> {
    let (values, outputs) = (&outcome.values, subject.node_type.outputs);
    if !outcome.report.faults.is_empty() {
        return None;
    }
    if values.len() != outputs.len() {
        return Some(format!("{} outputs, declared are {}", values.len(), outputs.len()));
    }
    values.iter().zip(outputs).find_map(|(value, output)| {
        let declared = match output.kind {
            OutputKind::Is(kind) => Some(kind),
            OutputKind::SameAs(port) => {
                Kind::OWN.into_iter().find(|kind| sources(*kind).contains(&subject.ports[port]))
            }
        };
        let other = Some(value.kind()) != declared;
        other.then(|| format!("`{}` is of kind {}", output.name, value.kind())).or_else(|| defect(value))
    })
}

/// What is wrong with a value by the rules of its kind.
fn defect(value: &Value) -> Option<String> {
    match value {
        Value::Image(image) => image_defect(image),
        Value::Mask(mask) => raster_defect(&mask.0).or_else(|| {
            let wrong = mask.0.samples.rows().flatten().find(|sample| !(0.0..=1.0).contains(*sample))?;
            Some(format!("coverage {wrong}"))
        }),
        Value::Field(field) => raster_defect(&field.0),
        Value::Labels(labels) => labels_defect(labels),
        Value::Grid(grid) => {
            let sound = grid.spacing.iter().all(|step| *step > 0.0) && grid.nodes.iter().all(|count| *count >= 2);
            (!sound).then(|| format!("{grid:?}"))
        }
        Value::Warp(warp) => {
            let count = warp.grid.node_count();
            (warp.x.len() != count || warp.y.len() != count).then(|| format!("{} positions", warp.x.len()))
        }
        Value::Number(number) => (!number.is_finite()).then(|| format!("{number}")),
        _ => None,
    }
}

fn image_defect(image: &Image) -> Option<String> {
    if image.layers.is_empty() || image.pixel_aspect.is_nan() || image.pixel_aspect <= 0.0 {
        return Some(format!("{} layers, pixel aspect {}", image.layers.len(), image.pixel_aspect));
    }
    let channels = image.layers.iter().flat_map(|layer| layer.channels.iter().map(move |channel| (layer, channel)));
    channels.into_iter().find_map(|(layer, channel)| {
        let twice = layer.channels.iter().filter(|other| other.name == channel.name).count() > 1;
        let size = (layer.data.width(), layer.data.height());
        let mistaken = matches!(channel.plane, Plane::U32(_)) != (&*channel.name == "id");
        let found = match &channel.plane {
            Plane::F32(samples) => (samples.width(), samples.height()),
            Plane::U32(samples) => (samples.width(), samples.height()),
        };
        (twice || mistaken || found != size).then(|| format!("{channel:?} in {:?}", layer.data))
    })
}

fn raster_defect<T: Sample>(raster: &Raster<T>) -> Option<String> {
    let size = (raster.samples.width(), raster.samples.height());
    let expected = (raster.windows.data.width(), raster.windows.data.height());
    (size != expected).then(|| format!("{size:?} samples in {:?}", raster.windows.data))
}

fn labels_defect(labels: &Labels) -> Option<String> {
    let raster = &labels.raster;
    let mut area = std::collections::BTreeMap::new();
    raster
        .samples
        .rows()
        .flatten()
        .filter(|label| **label != 0)
        .for_each(|label| *area.entry(*label).or_insert(0) += 1);
    let table: Vec<(u32, u64)> = labels.table.iter().map(|row| (row.label, row.area)).collect();
    let found: Vec<(u32, u64)> = area.into_iter().collect();
    raster_defect(raster).or_else(|| (table != found).then(|| format!("table {table:?}, pixels {found:?}")))
}

#[test]
fn usual_parameters_on_every_picture_and_source() {
    let subjects = node_types().flat_map(|node_type| Which::ALL.map(|which| Subject::new(node_type, which)));
    assert_all(subjects.flat_map(|subject| [vec![subject.clone()], subject.reconnected()].concat()));
}

#[test]
fn other_parameters_on_every_picture() {
    let subjects = node_types().flat_map(|node_type| Which::ALL.map(|which| Subject::new(node_type, which)));
    assert_all(subjects.flat_map(|subject| subject.reset(texts::others)));
}

#[test]
fn extreme_parameters() {
    let pictures = [Which::Large, Which::Pixel, Which::Shifted];
    let subjects = node_types().flat_map(|node_type| pictures.map(|which| Subject::new(node_type, which)));
    assert_all(subjects.flat_map(|subject| subject.reset(texts::extremes)));
}

/// Pictures that are sound and yet no maps of positions: one channel, numbers that are none, alpha 0 everywhere.
const NO_MAPS: [Which; 3] = [Which::Grey, Which::NotFinite, Which::Pixel];

/// A refusal is right only where the picture gives a reason.
#[test]
fn sound_pictures_are_not_refused() {
    let (stage, engine) = (Stage::new(), engine(2));
    for node_type in node_types() {
        for which in [
            Which::Plain,
            Which::Large,
            Which::Pixel,
            Which::Odd,
            Which::NotFinite,
            Which::Shifted,
            Which::NoAlpha,
            Which::Identities,
            Which::Grey,
        ] {
            if &*node_type.name == "LoadWarp" && NO_MAPS.contains(&which) {
                continue;
            }
            let outcome = stage.run(&engine, &Subject::new(node_type, which));
            let faults = &outcome.report.faults;
            assert!(faults.is_empty(), "{} on {which:?}: {faults:#?}", node_type.name);
        }
    }
}
