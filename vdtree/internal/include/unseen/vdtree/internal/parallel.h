// Loops of many threads, by oneTBB.
//
// The thread sanitizer does not see how TBB's tasks wait for each other, for the library is not built for it. It is told
// here: what was done before a loop comes before its tasks, and what they do before what follows the loop.
#pragma once

#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#ifdef __SANITIZE_THREAD__
extern "C" void __tsan_acquire(void* address);
extern "C" void __tsan_release(void* address);
#define UNSEEN_BEFORE_ORDER [[gnu::no_sanitize("thread")]]
#else
#define UNSEEN_BEFORE_ORDER // of what a task does before it is in order
#endif

namespace unseen {

// Made before tasks begin, and ended when all have ended; each task holds a Task.
class TaskOrder {
public:
    TaskOrder() { release(&begin_); }
    ~TaskOrder() { acquire(&end_); }
    TaskOrder(const TaskOrder&) = delete;
    TaskOrder& operator=(const TaskOrder&) = delete;

    class Task {
    public:
        explicit Task(const TaskOrder& order) : order_(order) { acquire(&order_.begin_); }
        ~Task() { release(&order_.end_); }
        Task(const Task&) = delete;
        Task& operator=(const Task&) = delete;

    private:
        const TaskOrder& order_;
    };

private:
    static void acquire([[maybe_unused]] void* address) {
#ifdef __SANITIZE_THREAD__
        __tsan_acquire(address);
#endif
    }
    static void release([[maybe_unused]] void* address) {
#ifdef __SANITIZE_THREAD__
        __tsan_release(address);
#endif
    }

    mutable char begin_, end_; // their addresses count, and nobody reads them
};

// A loop's body, as a task runs it.
template <class Body>
class OrderedBody {
public:
    OrderedBody(const TaskOrder& order, const Body& body) : order_(&order), body_(&body) {}
    UNSEEN_BEFORE_ORDER OrderedBody(const OrderedBody& other) : order_(other.order_), body_(other.body_) {}

    template <class Part>
    UNSEEN_BEFORE_ORDER void operator()(const Part& part) const {
        const TaskOrder::Task task(*order_);
        (*body_)(part);
    }

private:
    const TaskOrder* order_;
    const Body* body_;
};

// tbb::parallel_for() over first, first + 1, ... before last.
template <class Index, class Body>
void parallel_loop(Index first, Index last, const Body& body) {
    const TaskOrder order;
    tbb::parallel_for(first, last, OrderedBody(order, body));
}

// tbb::parallel_for() over parts of a range.
template <class Range, class Body, class... Partitioner>
void parallel_loop_over(const Range& range, const Body& body, Partitioner&&... partitioner) {
    const TaskOrder order;
    tbb::parallel_for(range, OrderedBody(order, body), std::forward<Partitioner>(partitioner)...);
}

} // namespace unseen
