#pragma once

namespace tomofield::cli {

/// Lets Ctrl-C (SIGINT) and SIGTERM ask the program to stop instead of ending it. In a job of
/// several processes SIGUSR1 asks for it too, because mpirun passes it on without a time limit.
void stop_on_signals(bool is_job = false);

/// Returns true if one of these signals has come.
bool stop_was_requested();

/// Returns the exit status of a stopped run: 128 plus the signal. If this process got no signal,
/// another process of the job did, and SIGTERM's status is returned.
int stop_status();

}  // namespace tomofield::cli
