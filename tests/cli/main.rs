//! Command-line tests: the real binary, in folders of its own.

mod cache;
mod codes;
mod desk;
mod dumps;
mod existing;
mod explain;
mod frames;
mod main_job;
mod paths;
mod progress;
mod queries;
mod report;
#[cfg(unix)]
mod signals;
mod wanted;
#[cfg(unix)]
mod watch;
