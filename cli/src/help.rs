//! What stands below the flags in `--help` and in the manual pages.

/// Exit codes, the same for every command.
const CODES: &str = "\
Exit codes:
   0  done
   1  some frames failed and some were delivered (with --keep-going)
   2  the command line is wrong or the graph invalid
   3  an input is missing or cannot be read
   4  an input is of a sort that is not supported
   5  a plugin is missing
   6  an output cannot be written
   7  a node refused its inputs, --memory does not suffice, or a comparison found a difference
  70  a bug of ours, or a node's panic
  75  stopped by a signal; finished frames are kept";

const VARIABLES: &str = "\
Environment:
  WARPLOOM_CACHE  folder of the cache, unless --cache says otherwise
  XDG_CACHE_HOME  where else the cache is: warploom in it (in ~/.cache without it)
  NO_COLOR        if not empty, nothing is coloured
  Any variable    stands in a graph's texts as $(env:NAME)";

pub fn line() -> String {
    format!(
        "\
Examples:
  warploom nodes                                 what nodes there are
  warploom nodes Arc                             one of them
  warploom check shot.ron                        every fault of a graph, and its mend
  warploom run shot.ron                          write the files of its Save nodes
  warploom run shot.ron --set bend.angle=75.0    again; only what the angle reaches runs
  warploom explain shot.ron                      what would run, and why

{CODES}

{VARIABLES}"
    )
}

pub fn run() -> String {
    format!(
        "\
Examples:
  warploom run shot.ron --frames 1001-1100 --keep-going --report report.json
  warploom run shot.ron --set bend.angle=75.0 --set 'plate.path=\"other.exr\"'
  warploom run shot.ron --target keep --dump keep=keep.json    the value on an edge
  warploom run shot.ron --watch                                again on every save
  warploom run shot.ron --existing verify                      compare, write nothing
  warploom run shot.ron --progress percent                     for a farm

Standard output has the written paths (with jsonl, an object per event), standard error all else.

{CODES}

{VARIABLES}"
    )
}

pub const CHECK: &str = "\
Examples:
  warploom check shot.ron
  warploom check shot.ron --frames 1001-1100 --set bend.angle=75.0    with the flags of `run`
  warploom check shot.ron --format json                              for an editor or a pipeline

Exit codes:
   0  no fault; warnings do not count
   2  the graph has faults, or the command line is wrong";

pub const EXPLAIN: &str = "\
Examples:
  warploom explain shot.ron
  warploom explain shot.ron --set bend.angle=75.0 --frames 1001    what a new angle would cost
  warploom explain shot.ron --format json

A pair is a node and a frame. It `runs`, or `may run` where an input will be computed again and
may come out the same, or is `reused`.

The exit code is 0, or that of the first fault: see `warploom run --help`.";

pub const NODES: &str = "\
Examples:
  warploom nodes                          all, a line each
  warploom nodes Resample                 its inputs, parameters with ranges and defaults, outputs
  warploom nodes --format json            all, as JSON Schema: the form of a plugin's manifest
  warploom nodes --format markdown --out pages --examples examples --pictures pictures

With --out, `examples/drop_shadow/graph.ron` is the example of a node type DropShadow, `graph.png`
beside it what that gives, and `pictures/drop_shadow.png` its picture.";

pub const GRAPH: &str = "\
Examples:
  warploom graph shot.ron | dot -Tsvg > shot.svg      with Graphviz
  warploom graph shot.ron --format mermaid            for a Markdown page
  warploom graph shot.ron --format json               for a program

What writes files is a cylinder, other targets have a double border; a dashed edge is a number
that a parameter is linked to.

Exit codes:
   0  done
   2  the graph has faults, or the command line is wrong";

pub const FMT: &str = "\
Examples:
  warploom fmt shot.ron                   in place; says the paths that it changed
  warploom fmt --check graphs/*.ron       for CI: changes nothing, names what it would
  warploom fmt - < shot.ron               from standard input to standard output

Comments stay, numbers and texts stay as they are written. A node has one line, values stand in a
column between blank lines; what is longer than 120 columns, or was begun on a new line behind its
bracket, has a line for each parameter.

Exit codes:
   0  done
   2  a file cannot be read or is no RON, and is left alone
   6  a file cannot be written
   7  with --check: a file would change";

pub const CACHE: &str = "\
Examples:
  warploom cache stat
  warploom cache gc --cache-size 20G
  warploom cache verify --cache /net/shared/warploom

Every command is safe while others render with the same cache. `verify` exits with 7 if it found a
damaged entry.";

pub const COMPLETIONS: &str = "\
Examples:
  warploom completions bash > ~/.local/share/bash-completion/completions/warploom
  warploom completions zsh > ~/.zfunc/_warploom         with ~/.zfunc in $fpath
  warploom completions fish > ~/.config/fish/completions/warploom.fish
  warploom completions powershell >> $PROFILE";

pub const MAN: &str = "\
Examples:
  warploom man | man -l -                               this command's page
  warploom man run | man -l -                           that of `warploom run`
  warploom man --out ~/.local/share/man/man1            all pages";
