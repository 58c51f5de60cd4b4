#include "child_process.h"

#include <array>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <unseen/vdtree/internal/stopwatch.h>

extern char** environ;

namespace unseen::app {
namespace {

std::string read_all(int descriptor) {
    std::string text;
    std::array<char, 4096> piece;
    for (;;) {
        const ssize_t count = read(descriptor, piece.data(), piece.size());
        if (count > 0) text.append(piece.data(), static_cast<std::size_t>(count));
        else if (count == 0 || errno != EINTR) return text;
    }
}

} // namespace

Result<ChildOutcome> run_child(std::vector<std::string> words) {
    const auto cannot = [&](int code) {
        return Error{ErrorCode::io_failure, "Cannot run '" + words.front() + "': " + std::strerror(code) + "."};
    };
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) return cannot(errno);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    pid_t process = -1;
    const auto start = vdtree::Clock::now();
    const int failed = posix_spawnp(&process, argv.front(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    ChildOutcome outcome;
    if (!failed) outcome.out = read_all(ends[0]);
    close(ends[0]);
    if (failed) return cannot(failed);
    int status = 0;
    while (waitpid(process, &status, 0) < 0)
        if (errno != EINTR) return cannot(errno);
    outcome.seconds = vdtree::seconds_since(start);
    outcome.status = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    return outcome;
}

} // namespace unseen::app
