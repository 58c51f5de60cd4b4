#include "interruption.h"

#include <atomic>
#include <csignal>
#include <cstdio>

#include <vdtree/internal/atomic_file.h>

namespace unseen::app {
namespace {

std::atomic<bool> is_interruptible = false;
std::atomic<int> remembered = 0; // a signal
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void end_by(int signal) {
    vdtree::AtomicFile::remove_all();
    std::signal(signal, SIG_DFL);
    std::raise(signal); // waits until a handler has returned
}

void on_signal(int signal) {
    int none = 0;
    if (is_interruptible && remembered.compare_exchange_strong(none, signal)) return;
    end_by(signal);
}

} // namespace

void clean_up_on_signals() {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction before {};
        if (::sigaction(signal, nullptr, &before) != 0 || before.sa_handler == SIG_IGN) continue;
        struct sigaction action {};
        action.sa_handler = on_signal;
        action.sa_flags = SA_RESTART;
        ::sigaction(signal, &action, nullptr);
    }
}

Interruptible::Interruptible() { is_interruptible = true; }
Interruptible::~Interruptible() { is_interruptible = false; }
bool Interruptible::is_interrupted() const { return remembered != 0; }

void end_if_interrupted() {
    if (remembered == 0) return;
    std::fflush(stdout);
    end_by(remembered);
}

} // namespace unseen::app
