//! `warploom cache`, and where the cache is.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use warploom_core::diag::{Code, Fault};
use warploom_core::engine::{CacheStat, DEFAULT_CACHE_SIZE, Disk, DiskTier, default_cache, plain};

use crate::args::{CacheArgs, CacheFolder, CacheWork};
use crate::terminal::{say, show};

/// The folder that is asked for, or else the user's.
pub fn folder(asked: &CacheFolder) -> Option<PathBuf> {
    asked.cache.clone().or_else(|| default_cache(&|name| std::env::var(name).ok()))
}

/// The command.
pub fn cache(args: &CacheArgs) -> u8 {
    let (CacheWork::Stat(place) | CacheWork::Gc(place) | CacheWork::Verify(place) | CacheWork::Clear(place)) =
        &args.work;
    let Some(folder) = folder(place) else {
        let hint = "name one with --cache, or set WARPLOOM_CACHE".to_owned();
        show(&Fault::new(Code::Usage, "there is no cache folder").hint(hint), false);
        return Code::Usage.exit_code();
    };
    if folder.exists() && !folder.is_dir() {
        show(&Fault::new(Code::OutputUnwritable, format!("{} is no folder", folder.display())), false);
        return Code::OutputUnwritable.exit_code();
    }
    let tier = DiskTier::new(&folder, Arc::new(Disk), place.cache_size.unwrap_or(DEFAULT_CACHE_SIZE));
    match work(&args.work, &tier) {
        Ok(code) => code,
        Err(error) => {
            let message = format!("the cache at {} cannot be looked after: {}", folder.display(), plain(&error));
            show(&Fault::new(Code::OutputUnwritable, message), false);
            Code::OutputUnwritable.exit_code()
        }
    }
}

fn work(work: &CacheWork, tier: &DiskTier) -> io::Result<u8> {
    match work {
        CacheWork::Stat(_) => tell(&tier.stat()?),
        CacheWork::Gc(_) => {
            let done = tier.collect()?;
            say(&format!("removed {} of {} files, {}", done.removed, done.entries, size(done.removed_bytes)));
            say(&format!("left {} of at most {}", size(done.left_bytes), size(tier.budget())));
        }
        CacheWork::Verify(_) => {
            let done = tier.verify()?;
            say(&format!("{} of {} entries were damaged and are removed", done.removed, done.entries));
            return Ok(if done.removed == 0 { 0 } else { Code::Nondeterministic.exit_code() });
        }
        CacheWork::Clear(_) => {
            let done = tier.clear()?;
            say(&format!("removed {} files, {}", done.removed, size(done.removed_bytes)));
        }
    }
    Ok(0)
}

fn tell(stat: &CacheStat) {
    say(&format!("{}", stat.folder.display()));
    for (table, count, bytes) in &stat.tables {
        say(&format!("{table:<10} {count:>9}  {:>10}", size(*bytes)));
    }
    let (count, bytes) = stat.temporary;
    say(&format!("{:<10} {count:>9}  {:>10}", "unfinished", size(bytes)));
    say(&format!("{:<10} {:>9}  {:>10} of at most {}", "all", "", size(stat.bytes()), size(stat.budget)));
}

/// Bytes for people, in powers of 1024 as the flags take them.
fn size(bytes: u64) -> String {
    let units = ["B", "K", "M", "G", "T"];
    let unit = (0..units.len() - 1).find(|&unit| bytes < 1024u64.pow(unit as u32 + 1)).unwrap_or(units.len() - 1);
    match unit {
        0 => format!("{bytes} B"),
        _ => format!("{:.1} {}", bytes as f64 / 1024f64.powi(unit as i32), units[unit]),
    }
}
