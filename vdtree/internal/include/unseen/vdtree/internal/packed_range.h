// Unions of ranges of luminance.
#pragma once

#include <unseen/vdtree/vertex_tree.h>

namespace unseen::vdtree {

// By values: a minimum of references would be loaded from memory after an unpredictable branch.
inline PackedRange unite(PackedRange a, PackedRange b) {
    const std::uint16_t lo = a.lo.value < b.lo.value ? a.lo.value : b.lo.value,
                        hi = a.hi.value > b.hi.value ? a.hi.value : b.hi.value;
    return {{lo}, {hi}};
}

} // namespace unseen::vdtree
