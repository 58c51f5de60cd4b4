#include "interruption.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <string_view>
#include <system_error>
#include <thread>

#include <unistd.h>

#include <unseen/vdtree/internal/atomic_file.h>
#include <unseen/vdtree/internal/mapped_names.h>

#include "command.h"
#include "output_files.h"

namespace unseen::app {
namespace {

std::atomic<bool> is_interruptible = false;
std::atomic<int> remembered = 0; // a signal
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void end_by(int signal) {
    vdtree::AtomicFile::remove_all();
    remove_empty_made_folders();
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

// The first thread that finds it out says so and ends the program; the others, the watching one as well, wait for that.
[[noreturn]] void end_for_changed(const char* file) {
    static std::atomic_flag is_said = ATOMIC_FLAG_INIT;
    while (is_said.test_and_set()) ::pause();
    write_plainly("unseen: '");
    write_plainly(file);
    write_plainly("' was cut short or changed while it was read: write it anew, under another name, and rename it.");
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, "\n", 1);
    vdtree::AtomicFile::remove_all();
    remove_empty_made_folders();
    ::_exit(exit_failed);
}

constexpr std::array fault_signals = {SIGBUS, SIGSEGV, SIGFPE, SIGABRT};
std::array<struct sigaction, fault_signals.size()> usual_actions;

// A mapped file that becomes shorter raises SIGBUS; one that is written to may lead to any fault. Other faults have
// their usual end.
void on_fault(int signal, siginfo_t* info, void*) {
    const bool is_fault = info->si_code > 0;
    const char* const cut_short = is_fault && signal == SIGBUS ? vdtree::mapped_file_at(info->si_addr) : nullptr;
    if (const char* file = cut_short ? cut_short : vdtree::changed_mapped_file()) end_for_changed(file);
    vdtree::AtomicFile::remove_all();
    const auto place = std::find(fault_signals.begin(), fault_signals.end(), signal) - fault_signals.begin();
    ::sigaction(signal, &usual_actions[static_cast<std::size_t>(place)], nullptr);
    if (!is_fault) std::raise(signal); // else it is raised again where it was
}

// What is read from a file that is written to meanwhile may also have no end.
void watch_mapped_files() {
    constexpr auto pause = std::chrono::seconds(1);
    for (;; std::this_thread::sleep_for(pause))
        if (const char* file = vdtree::changed_mapped_file()) end_for_changed(file);
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
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO;
    for (std::size_t i = 0; i < fault_signals.size(); ++i) ::sigaction(fault_signals[i], &action, &usual_actions[i]);
    try {
        std::thread(watch_mapped_files).detach();
    } catch (const std::system_error&) { // no more threads: then nothing is watched
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
