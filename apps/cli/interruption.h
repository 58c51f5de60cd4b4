// Ctrl-C and its like: SIGINT, SIGTERM, SIGHUP. What is half done goes, what is done stays, and the process ends by the
// signal, as its parent expects.
#pragma once

namespace unseen::app {

// From now on such a signal removes temporary files before it ends the process. Signals that are ignored stay so. A
// page that a mapped file has lost, because another program cut it short, ends the process with a sentence that names
// the file.
void clean_up_on_signals();

// While one lives, the first signal is only remembered, for a loop that ends early and keeps what it has; the second
// one ends the process. One at a time.
class Interruptible {
public:
    Interruptible();
    Interruptible(const Interruptible&) = delete;
    Interruptible& operator=(const Interruptible&) = delete;
    ~Interruptible();

    bool is_interrupted() const;
};

// Ends the process by the signal that an Interruptible has remembered; does nothing if there was none.
void end_if_interrupted();

} // namespace unseen::app
