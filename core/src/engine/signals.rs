//! Signals that would end the process where an error can be told.

/// Has a write beyond the system's limit on the size of files (`ulimit -f`) fail like any other, for the whole process.
/// Without it the system ends the process there, with nothing said and a temporary file left.
///
/// Does nothing where there is no such signal.
pub fn let_large_writes_fail() {
    #[cfg(unix)]
    #[allow(unsafe_code)]
    // SAFETY: signal takes two numbers by value, and SIG_IGN runs no code of ours.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}
