//! The priority of the console's threads.

/// Lowers the priority of the calling thread below that of the control loop, so that drawing never delays measuring. Does
/// nothing where threads have no priority of their own.
pub(crate) fn lower_thread_priority() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(5) {
        tracing::debug!("the priority of a console thread stays as it is: {error}");
    }
}
