// The command's own operator new and delete: large blocks are paged where that is asked for. The forms for arrays, and those that do
// not throw, use these.
#include <algorithm>
#include <cstdlib>
#include <new>

#include "paged_memory.h"

using namespace unseen::app;

void* operator new(std::size_t size) {
    if (size >= least_paged_block)
        if (void* block = allocate_paged(size)) return block;
    for (;;) {
        if (void* block = std::malloc(std::max<std::size_t>(size, 1))) return block;
        const std::new_handler handler = std::get_new_handler();
        if (!handler) throw std::bad_alloc();
        handler();
    }
}

void operator delete(void* block) noexcept {
    if (!release_paged(block)) std::free(block);
}

void operator delete(void* block, std::size_t) noexcept {
    if (!release_paged(block)) std::free(block);
}
