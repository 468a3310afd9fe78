#pragma once

namespace tomofield::cli {

/// From now on Ctrl-C (SIGINT), SIGTERM and, of a job of several processes, SIGUSR1 (which mpirun
/// passes on without a time limit) ask the program to stop instead of ending it.
void stop_on_signals(bool is_job = false);

/// Whether one of them has come.
bool stop_was_requested();

/// The exit status of what was stopped by it: 128 and the signal; SIGTERM's if none came here,
/// since of a job another process may have got it.
int stop_status();

}  // namespace tomofield::cli
