//! `warploom explain`.

use std::sync::Arc;

use warploom_core::diag::Code;
use warploom_core::engine::{Explanation, From, PairVerdict, Verdict};
use warploom_core::registry::Registry;

use crate::args::{CheckFormat, ExplainArgs};
use crate::run::{engine, existing};
use crate::terminal::{note, say, show, show_warnings};

/// The command. Exit code 0, or that of the first fault.
pub fn explain(args: &ExplainArgs, registry: &Registry) -> u8 {
    let checked = crate::check::read(&args.file, &[], registry);
    show_warnings(&checked.warnings);
    let Some(plan) = checked.plan.map(Arc::new) else {
        checked.faults.iter().for_each(|fault| show(fault, false));
        let plugin_missing = checked.faults.iter().any(|fault| fault.code == Code::MissingPlugin);
        return if plugin_missing { Code::MissingPlugin } else { Code::Usage }.exit_code();
    };
    let engine = engine(&args.engine);
    let explanation = engine.explain(&plan, existing(args.engine.existing));
    match args.format {
        CheckFormat::Json => say(&serde_json::to_string(&explanation).unwrap_or_default()),
        CheckFormat::Human => tell(&explanation),
    }
    explanation.faults.iter().for_each(|fault| show(fault, false));
    if let Some(warning) = engine.take_cache_warning() {
        note(&format!("warning: {warning}"));
    }
    explanation.faults.first().map_or(0, |fault| fault.code.exit_code())
}

fn tell(explanation: &Explanation) {
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
