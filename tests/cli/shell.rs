//! Completions, manual pages and `--help`: what the command line says of itself.

use std::process::{Command, Stdio};

use crate::desk::Desk;

const COMMANDS: [&str; 9] = ["run", "check", "explain", "nodes", "graph", "fmt", "cache", "completions", "man"];

#[test]
fn shells_get_scripts() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = desk.run(&format!("completions {shell}")).expect(0).stdout;
        let words = COMMANDS.iter().chain(&["keep-going"]);
        words.for_each(|word| assert!(script.contains(word), "{shell} does not know {word}"));
    }
    // Not every shell completes what is no flag.
    assert!(desk.run("completions bash").expect(0).stdout.contains("FeatureWarp"));
    desk.run("completions tcsh").says(2, &["bash"]);
}

#[test]
fn bash_reads_its_script_and_completes_with_it() {
    let desk = Desk::new();
    let script = desk.run("completions bash").expect(0).stdout;
    desk.write("warploom.bash", script);
    let bash = |line: &str| {
        let mut command = Command::new("bash");
        command.args(["-c", line]).current_dir(desk.path("")).stdin(Stdio::null()).output()
    };
    // A machine without bash has nothing to complete.
    let Ok(read) = bash("bash -n warploom.bash") else { return };
    assert!(read.status.success(), "{read:?}");
    let line = "source warploom.bash; COMP_WORDS=(warploom ex); COMP_CWORD=1; _warploom warploom ex warploom; \
                echo \"${COMPREPLY[@]}\"";
    let completed = bash(line).expect("it was there");
    assert_eq!(String::from_utf8_lossy(&completed.stdout).trim(), "explain", "{completed:?}");
}

#[test]
fn every_command_has_a_manual_page() {
    let desk = Desk::new();
    let written = desk.run("man --out man").expect(0).stdout;
    assert_eq!(written.lines().count(), desk.files("man").len());
    for command in COMMANDS {
        let name = format!("warploom-{command}");
        let page = String::from_utf8(desk.read(&format!("man/{name}.1"))).expect("UTF-8");
        assert!(page.contains(&format!(".TH {name} 1")) && page.contains(".SH SYNOPSIS"), "{page}");
        assert_eq!(desk.run(&format!("man {command}")).expect(0).stdout, page);
    }
    let whole = desk.run("man").expect(0).stdout;
    assert!(whole.contains(".TH warploom 1") && whole.contains(".SH \"EXIT CODES\"\n.nf\n   0  done\n"), "{whole}");
    assert!(desk.files("man").contains(&"warploom-cache-gc.1".to_owned()));
    assert!(whole.contains("\n.SH \"EXAMPLES\"\n.nf\n  warploom nodes "), "{whole}");
    desk.run("man rum").says(2, &["did you mean `run`?"]);
}

#[test]
fn help_has_examples_that_are_commands() {
    let desk = Desk::new();
    let of = |command: &str| desk.run(&format!("{command} --help")).expect(0).stdout;
    let helps: Vec<String> = COMMANDS.iter().map(|command| of(command)).chain([of("")]).collect();
    for help in &helps {
        assert!(help.contains("\nExamples:\n"), "{help}");
        assert!(help.lines().all(|line| line.chars().count() <= 100), "{help}");
        let examples = help.lines().filter_map(|line| line.strip_prefix("  warploom "));
        for example in examples {
            let command = example.split_whitespace().next().unwrap_or_default();
            assert!(COMMANDS.contains(&command), "{example}");
            let flags = example.split_whitespace().filter(|word| word.starts_with("--"));
            let known = of(command) + &desk.run("cache gc --help").expect(0).stdout;
            flags.for_each(|flag| assert!(known.contains(flag), "{example}: {flag}"));
        }
    }
    let whole = helps.last().expect("it is the last");
    ["Exit codes:", "Environment:", "NO_COLOR"].iter().for_each(|word| assert!(whole.contains(word), "{whole}"));
    assert!(desk.run("run -h").expect(0).stdout.lines().count() < 60, "the short help is short");
}
