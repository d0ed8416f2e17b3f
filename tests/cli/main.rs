//! Command-line tests: the real binary, in folders of its own.

mod cache;
mod codes;
mod desk;
mod dumps;
mod existing;
mod explain;
mod fmt;
mod frames;
mod main_job;
mod pages;
mod paths;
mod progress;
mod queries;
mod report;
mod shell;
#[cfg(unix)]
mod signals;
mod wanted;
#[cfg(unix)]
mod watch;
