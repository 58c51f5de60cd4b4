// The command's own operator new and delete: large blocks are paged where that is asked for, else they get large pages.
// The forms for arrays use these.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

#include <sys/mman.h>

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

// Of a page of the larger kind, on most machines.
constexpr std::size_t large_page = std::size_t{2} << 20;

// Asks for large pages for what lies within the block: a build walks its arrays in several orders at once, and looking
// up small pages takes a tenth of its time and more. Nothing depends on whether the system grants it.
void* with_large_pages(void* block, std::size_t size) {
#ifdef MADV_HUGEPAGE
    if (!block || size < 2 * large_page) return block;
    const auto begin = reinterpret_cast<std::uintptr_t>(block),
               inside = (begin + large_page - 1) / large_page * large_page;
    const std::uintptr_t end = (begin + size) / large_page * large_page;
    ::madvise(static_cast<std::byte*>(block) + (inside - begin), end - inside, MADV_HUGEPAGE);
#endif
    return block;
}

void give_back(void* block) noexcept {
    if (!release_paged(block)) std::free(block);
}

} // namespace

void* operator new(std::size_t size) {
    if (size >= least_paged_block)
        if (void* block = allocate_paged(size)) return block;
    return from_memory([=] { return with_large_pages(std::malloc(std::max<std::size_t>(size, 1)), size); });
}

void* operator new(std::size_t size, std::align_val_t alignment) {
    const auto align = static_cast<std::size_t>(alignment);
    if (size >= least_paged_block && align <= paged_alignment)
        if (void* block = allocate_paged(size)) return block;
    const std::size_t rounded = (std::max<std::size_t>(size, 1) + align - 1) / align * align;
    if (rounded < size) throw std::bad_alloc();
    return from_memory([=] { return with_large_pages(std::aligned_alloc(align, rounded), rounded); });
}

// The standard library's own would do, but a sanitizer's stand in their place, whose memory `delete` cannot give back.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    try {
        return operator new(size);
    } catch (const std::bad_alloc&) {
        return nullptr;
    }
}

void* operator new(std::size_t size, std::align_val_t alignment, const std::nothrow_t&) noexcept {
    try {
        return operator new(size, alignment);
    } catch (const std::bad_alloc&) {
        return nullptr;
    }
}

void operator delete(void* block) noexcept { give_back(block); }
void operator delete(void* block, std::size_t) noexcept { give_back(block); }
void operator delete(void* block, std::align_val_t) noexcept { give_back(block); }
void operator delete(void* block, std::size_t, std::align_val_t) noexcept { give_back(block); }
