// An X display for tests that open windows: the one in DISPLAY, or an Xvfb of our own for as long as this lives.
#pragma once

#include <csignal>
#include <cstdlib>
#include <string>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace unseen::render::testing {

class VirtualDisplay {
public:
    VirtualDisplay() {
        if (std::getenv("DISPLAY")) return;
        int ends[2];
        if (pipe(ends) != 0) {
            reason_ = "no pipe to Xvfb";
            return;
        }
        fcntl(ends[0], F_SETFD, FD_CLOEXEC);
        std::string descriptor = std::to_string(ends[1]);
        char program[] = "Xvfb", displayfd[] = "-displayfd", screen[] = "-screen", zero[] = "0", size[] = "640x480x24",
             nolisten[] = "-nolisten", tcp[] = "tcp";
        char* arguments[] = {program, displayfd, descriptor.data(), screen, zero, size, nolisten, tcp, nullptr};
        posix_spawn_file_actions_t quiet;
        posix_spawn_file_actions_init(&quiet);
        // Not the test's own: who reads them would wait for the server, too, where a test dies without stopping it.
        for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
            posix_spawn_file_actions_addopen(&quiet, stream, "/dev/null", O_WRONLY, 0);
        const int failed = posix_spawnp(&process_, program, &quiet, nullptr, arguments, environ);
        posix_spawn_file_actions_destroy(&quiet);
        close(ends[1]);
        if (failed) {
            process_ = -1;
            reason_ = "neither DISPLAY nor Xvfb";
        } else {
            wait_for_number(ends[0]);
        }
        close(ends[0]);
    }

    VirtualDisplay(const VirtualDisplay&) = delete;
    VirtualDisplay& operator=(const VirtualDisplay&) = delete;

    ~VirtualDisplay() {
        if (process_ <= 0) return;
        kill(process_, SIGTERM);
        waitpid(process_, nullptr, 0);
    }

    // Why there is no display, empty if there is one.
    const std::string& reason() const { return reason_; }

private:
    // Xvfb writes its display number and a newline when it is ready.
    void wait_for_number(int from) {
        constexpr int patience_ms = 20000; // on a busy machine
        std::string number;
        pollfd ready{from, POLLIN, 0};
        char c = 0;
        while (poll(&ready, 1, patience_ms) == 1 && read(from, &c, 1) == 1) {
            if (c == '\n') {
                setenv("DISPLAY", (":" + number).c_str(), 1);
                return;
            }
            number += c;
        }
        reason_ = "Xvfb does not start";
    }

    pid_t process_ = -1;
    std::string reason_;
};

} // namespace unseen::render::testing
