//! `warploom explain`.

use std::sync::Arc;

use warploom_core::engine::{Explanation, From, PairVerdict, Verdict};
use warploom_core::registry::Registry;

use crate::args::{CheckFormat, Existing, ExplainArgs};
use crate::run::{engine, existing, refusal};
use crate::terminal::{note, say, show, show_warnings};

/// The command. Exit code 0, or that of the first fault.
pub fn explain(args: &ExplainArgs, registry: &Registry) -> u8 {
    let checked = crate::check::read(&args.file, &[], registry);
    show_warnings(&checked.warnings);
    let Some(plan) = checked.plan.map(Arc::new) else {
        let graph = std::path::absolute(&args.file.graph).unwrap_or_else(|_| args.file.graph.clone());
        let explanation =
            Explanation { schema: 1, graph, frames: Vec::new(), nodes: Vec::new(), faults: checked.faults };
        return show_all(args, &explanation, refusal(&explanation.faults));
    };
    let engine = engine(&args.engine);
    let explanation = engine.explain(&plan, existing(args.engine.existing));
    let code = explanation.faults.first().map_or(0, |fault| fault.code.exit_code());
    let code = show_all(args, &explanation, code);
    if let Some(warning) = engine.take_cache_warning() {
        note(&format!("warning: {warning}"));
    }
    code
}

fn show_all(args: &ExplainArgs, explanation: &Explanation, code: u8) -> u8 {
    match args.format {
        CheckFormat::Json => say(&serde_json::to_string(explanation).unwrap_or_default()),
        CheckFormat::Human => {
            tell(explanation, args.engine.existing);
            explanation.faults.iter().for_each(|fault| show(fault, false));
        }
    }
    code
}

fn tell(explanation: &Explanation, existing: Existing) {
    if explanation.nodes.is_empty() {
        return;
    }
    let name = |pair: &PairVerdict| pair.frame.map_or(pair.node.to_string(), |frame| format!("{}@{frame}", pair.node));
    let width = explanation.nodes.iter().map(|pair| name(pair).chars().count()).max().unwrap_or_default();
    for pair in &explanation.nodes {
        let verdict = match pair.verdict {
            Verdict::Runs => "runs   ",
            Verdict::MayRun => "may run",
            Verdict::Reused => "reused ",
        };
        let reason = match (&pair.why, pair.from) {
            (Some(why), _) => why.at.as_ref().map_or(why.text.clone(), |at| format!("{} ({at})", why.text)),
            (None, Some(From::File)) if existing == Existing::Skip => "a file is there and stays".to_owned(),
            (None, Some(From::File)) => "its file is as it was written".to_owned(),
            (None, Some(_)) => "its result is known".to_owned(),
            (None, None) => "nothing needs it".to_owned(),
        };
        say(&format!("{verdict}  {:width$}  {reason}", name(pair)));
    }
    let count = |verdict| explanation.nodes.iter().filter(|pair| pair.verdict == verdict).count();
    let (run, may, reused) = (count(Verdict::Runs), count(Verdict::MayRun), count(Verdict::Reused));
    note(&format!("{run} would run, {may} may run, {reused} reused"));
}
