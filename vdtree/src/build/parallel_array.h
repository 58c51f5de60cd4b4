// Many values that all threads make. The system clears pages where they are first touched, which takes as long as
// filling them; one thread doing that for a whole array would keep the others waiting.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>

#include <unseen/vdtree/internal/parallel.h>

namespace unseen::vdtree {

// Says that everything will be written before it is read: nothing is touched until then.
struct Unfilled {};

// As many values as were asked for first, value-initialised or unfilled.
template <class T>
class ParallelArray {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

public:
    ParallelArray() = default;
    ParallelArray(std::size_t size, Unfilled) : values_(std::allocator<T>().allocate(size), Deallocate{size}) {}
    explicit ParallelArray(std::size_t size) : ParallelArray(size, Unfilled()) {
        constexpr std::size_t grain = 1 << 14;
        parallel_loop_over(tbb::blocked_range<std::size_t>(0, size, grain), [&](const auto& range) {
            std::uninitialized_value_construct_n(values_.get() + range.begin(), range.size());
        });
    }

    T& operator[](std::size_t i) noexcept { return values_[i]; }
    const T& operator[](std::size_t i) const noexcept { return values_[i]; }
    std::size_t size() const noexcept { return values_.get_deleter().size; }
    operator std::span<T>() noexcept { return {values_.get(), size()}; }
    operator std::span<const T>() const noexcept { return {values_.get(), size()}; }

private:
    struct Deallocate {
        std::size_t size = 0;
        void operator()(T* values) const { std::allocator<T>().deallocate(values, size); }
    };
    std::unique_ptr<T[], Deallocate> values_;
};

} // namespace unseen::vdtree
