// Every allocation of a program passes here, so that a test can tell how large the largest was: of one that a lying header
// asked for. For one source file of a program, for it defines the operators new and delete.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace {
std::atomic<std::size_t> largest_allocation{0};

void* counted_allocation(std::size_t size) noexcept {
    std::size_t largest = largest_allocation.load();
    while (size > largest && !largest_allocation.compare_exchange_weak(largest, size)) {
    }
    return std::malloc(size == 0 ? 1 : size);
}
void* counted_allocation_or_throw(std::size_t size) {
    if (void* memory = counted_allocation(size)) return memory;
    throw std::bad_alloc();
}
} // namespace

// All that the operators delete below give back; the forms for over-aligned types stay a pair of their own. Where the
// compiler put one of a pair inline and not the other, it would warn of memory from elsewhere.
[[gnu::noinline]] void* operator new(std::size_t size) { return counted_allocation_or_throw(size); }
[[gnu::noinline]] void* operator new[](std::size_t size) { return counted_allocation_or_throw(size); }
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    return counted_allocation(size);
}
[[gnu::noinline]] void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
    return counted_allocation(size);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete[](void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
