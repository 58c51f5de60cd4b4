// The command's own operator new and delete: large blocks are paged where that is asked for. The forms for arrays, and those that do
// not throw, use these.
#include <algorithm>
#include <cstdlib>
#include <new>

#include "paged_memory.h"

using namespace unseen::app;

namespace {

// Memory as usual, by `allocate`, which returns null where there is none.
template <class Allocate>
void* from_memory(Allocate&& allocate) {
    for (;;) {
        if (void* block = allocate()) return block;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}

void give_back(void* block) noexcept {
    if (!release_paged(block)) std::free(block);
}

} // namespace

void* operator new(std::size_t size) {
    if (size >= least_paged_block)
        if (void* block = allocate_paged(size)) return block;
    return from_memory([=] { return std::malloc(std::max<std::size_t>(size, 1)); });
}

void* operator new(std::size_t size, std::align_val_t alignment) {
    const auto align = static_cast<std::size_t>(alignment);
    if (size >= least_paged_block && align <= paged_alignment)
        if (void* block = allocate_paged(size)) return block;
    const std::size_t rounded = (std::max<std::size_t>(size, 1) + align - 1) / align * align;
    if (rounded < size) throw std::bad_alloc();
    return from_memory([=] { return std::aligned_alloc(align, rounded); });
}

void operator delete(void* block) noexcept { give_back(block); }
void operator delete(void* block, std::size_t) noexcept { give_back(block); }
void operator delete(void* block, std::align_val_t) noexcept { give_back(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { give_back(block); }
