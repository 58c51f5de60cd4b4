#include "interruption.h"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <string_view>

#include <unistd.h>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/mapped_names.h>

#include "command.h"

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

// Async-signal-safe; as printable(), but that letters of other languages are dots, too.
void write_plainly(std::string_view text) {
    for (const char c : text) {
        const char shown = c >= ' ' && c <= '~' ? c : '.';
        [[maybe_unused]] const auto written = ::write(STDERR_FILENO, &shown, 1);
    }
}

// What a mapped file's pages raise when the file has become shorter than it was. Other causes are not for a sentence.
void on_lost_page(int signal, siginfo_t* info, void*) {
    const char* const file = info->si_code > 0 ? vdtree::mapped_file_at(info->si_addr) : nullptr;
    if (!file) return end_by(signal);
    write_plainly("unseen: '");
    write_plainly(file);
    write_plainly("' was cut short while it was read: write it anew, under another name, and rename it.");
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, "\n", 1);
    vdtree::AtomicFile::remove_all();
    ::_exit(exit_failed);
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
    struct sigaction action {};
    action.sa_sigaction = on_lost_page;
    action.sa_flags = SA_SIGINFO;
    ::sigaction(SIGBUS, &action, nullptr);
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
