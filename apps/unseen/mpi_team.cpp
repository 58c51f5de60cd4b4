// The team over MPI: point-to-point messages of bytes.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include <mpi.h>
#include <sched.h>
#include <unistd.h>

#include "process_team.h"

namespace unseen::app {
namespace {

// MPI counts in ints; longer messages go in pieces.
constexpr std::size_t largest_piece = std::size_t{1} << 30; // bytes
constexpr int length_tag = 1, piece_tag = 2;
// MPI waits by asking over and over, and takes a core from those that are waited for. We ask now and then.
constexpr std::chrono::microseconds first_pause{20}, longest_pause{1000};

void require(int outcome) {
    if (outcome != MPI_SUCCESS) throw std::runtime_error("a process of the team cannot be reached any more.");
}

void wait_for(MPI_Request request) {
    auto pause = first_pause;
    for (int done = 0;;) {
        require(MPI_Test(&request, &done, MPI_STATUS_IGNORE));
        if (done) return;
        std::this_thread::sleep_for(pause);
        pause = std::min(2 * pause, longest_pause);
    }
}

void send_piece(const void* bytes, std::size_t size, int to, int tag) {
    MPI_Request request = MPI_REQUEST_NULL;
    require(MPI_Isend(bytes, static_cast<int>(size), MPI_BYTE, to, tag, MPI_COMM_WORLD, &request));
    wait_for(request);
}

void receive_piece(void* bytes, std::size_t size, int from, int tag) {
    MPI_Request request = MPI_REQUEST_NULL;
    require(MPI_Irecv(bytes, static_cast<int>(size), MPI_BYTE, from, tag, MPI_COMM_WORLD, &request));
    wait_for(request);
}

// mpirun binds each process to a core of its own. Ours have threads, and one goes on when the others are done: they
// share what mpirun itself, the parent, may use.
int share_cores() {
    cpu_set_t cores;
    if (sched_getaffinity(getppid(), sizeof(cores), &cores) == 0 && sched_setaffinity(0, sizeof(cores), &cores) == 0)
        return CPU_COUNT(&cores);
    if (sched_getaffinity(0, sizeof(cores), &cores) == 0) return CPU_COUNT(&cores);
    return 1;
}

// Ours are few large messages, for which the simplest of Open MPI's ways will do: it is there over any network, and
// some tenths of a second sooner than the others. Who starts us may choose another one.
void prefer_quick_start() { ::setenv("OMPI_MCA_pml", "ob1", 0); }

// The number of this process, as mpirun tells it before MPI has started.
std::optional<int> rank_from_mpirun() {
    for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"})
        if (const char* rank = std::getenv(name)) return std::atoi(rank);
    return std::nullopt;
}

// Does one task after another. MPI wants to be called by one thread, and waits for other processes for a while when it
// starts and ends: so that thread is this one, and ours goes on.
class TaskThread {
public:
    TaskThread() : thread_([this] { work(); }) {}
    ~TaskThread() {
        begin({}); // to end with
        thread_.join();
    }
    TaskThread(const TaskThread&) = delete;
    TaskThread& operator=(const TaskThread&) = delete;

    std::future<void> begin(std::packaged_task<void()> task) {
        std::future<void> done = task.valid() ? task.get_future() : std::future<void>();
        const std::lock_guard lock(mutex_);
        tasks_.push_back(std::move(task));
        more_.notify_one();
        return done;
    }
    // Waits for it, and throws what it throws.
    template <class Task>
    void run(Task&& task) {
        begin(std::packaged_task<void()>(task)).get();
    }

private:
    void work() {
        for (;;) {
            std::unique_lock lock(mutex_);
            more_.wait(lock, [this] { return !tasks_.empty(); });
            std::packaged_task<void()> task = std::move(tasks_.front());
            tasks_.pop_front();
            lock.unlock();
            if (!task.valid()) return;
            task();
        }
    }

    std::mutex mutex_;
    std::condition_variable more_;
    std::deque<std::packaged_task<void()>> tasks_;
    std::thread thread_; // last: it uses the others
};

class MpiTeam : public ProcessTeam {
public:
    MpiTeam() : cores_(share_cores()), told_rank_(rank_from_mpirun()) {
        prefer_quick_start();
        mpi_.emplace();
        started_ = mpi_->begin(std::packaged_task<void()>([this] { start(); })).share();
    }

    int rank() const override {
        if (told_rank_) return *told_rank_;
        started_.get();
        return rank_;
    }
    int size() const override {
        started_.get();
        return size_;
    }
    int cores() const override { return cores_; }
    int members_on_machine() const override {
        started_.get();
        return on_machine_;
    }

    void send(int to, std::span<const std::byte> message) override {
        started_.get();
        mpi_->run([=] {
            const std::uint64_t length = message.size();
            send_piece(&length, sizeof(length), to, length_tag);
            for (std::size_t at = 0; at < message.size(); at += largest_piece)
                send_piece(message.data() + at, std::min(largest_piece, message.size() - at), to, piece_tag);
        });
    }

    std::vector<std::byte> receive(int from) override {
        started_.get();
        std::vector<std::byte> message;
        mpi_->run([&message, from] {
            std::uint64_t length = 0;
            receive_piece(&length, sizeof(length), from, length_tag);
            message.resize(length);
            for (std::size_t at = 0; at < message.size(); at += largest_piece)
                receive_piece(message.data() + at, std::min(largest_piece, message.size() - at), from, piece_tag);
        });
        return message;
    }

    void leave() override {
        started_.get();
        mpi_->begin(std::packaged_task<void()>([] {
            MPI_Request all_here = MPI_REQUEST_NULL;
            require(MPI_Ibarrier(MPI_COMM_WORLD, &all_here));
            wait_for(all_here);
            require(MPI_Finalize());
        }));
    }

private:
    void start() {
        int provided = 0;
        require(MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided));
        require(MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN));
        require(MPI_Comm_rank(MPI_COMM_WORLD, &rank_));
        require(MPI_Comm_size(MPI_COMM_WORLD, &size_));
        MPI_Comm machine = MPI_COMM_NULL;
        require(MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine));
        require(MPI_Comm_size(machine, &on_machine_));
        require(MPI_Comm_free(&machine));
        if (told_rank_ && *told_rank_ != rank_)
            throw std::runtime_error("mpirun and MPI number the processes in different ways.");
    }

    int cores_, rank_ = 0, size_ = 1, on_machine_ = 1;
    std::optional<int> told_rank_;
    std::shared_future<void> started_;
    std::optional<TaskThread> mpi_; // last: its tasks use the others
};

} // namespace

bool ProcessTeam::is_there() noexcept { return true; }

Result<std::unique_ptr<ProcessTeam>> ProcessTeam::join() {
    // Without mpirun, MPI would start a server of its own for nothing.
    if (!std::getenv("OMPI_COMM_WORLD_SIZE") && !std::getenv("PMI_SIZE") && !std::getenv("PMIX_RANK"))
        return std::unique_ptr<ProcessTeam>();
    return std::unique_ptr<ProcessTeam>(std::make_unique<MpiTeam>());
}

} // namespace unseen::app
