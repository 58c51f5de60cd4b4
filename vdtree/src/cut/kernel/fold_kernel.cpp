#include "cut/kernel/fold_kernel.h"

#include "cut/kernel/deadline_kernel.h"
#include <unseen/vdtree/internal/simd.h>

namespace unseen::vdtree {

namespace {

// GCC takes vectors apart that it meets in functions for others, even where these are inlined. So the arithmetic is
// included once for each kind of register, as a whole, within the region that is compiled for it. (With registers of
// sixteen floats, tests from the cache take four fifths of the time, but frames and jumps take as long.)
namespace four_wide {

using Vectors = FourWide;
#include "cut/kernel/table.h"

} // namespace four_wide

#if defined(UNSEEN_EIGHT_WIDE)
#pragma GCC push_options
#pragma GCC target("avx2")
namespace eight_wide {

using Vectors = EightWide;
#include "cut/kernel/table.h"

} // namespace eight_wide
#pragma GCC pop_options
const bool is_wide = has_avx2();
#else
constexpr bool is_wide = false;
namespace eight_wide = four_wide;
#endif

} // namespace

const FoldKernel fold_kernel = is_wide ? eight_wide::fold_table : four_wide::fold_table;
const DeadlineKernel deadline_kernel = is_wide ? eight_wide::deadline_table : four_wide::deadline_table;

} // namespace unseen::vdtree
