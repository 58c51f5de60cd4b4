#include "build/spatial_order.h"

namespace unseen::vdtree {

void sort_by_code(std::span<CodedIndex> items, std::span<CodedIndex> scratch) {
    constexpr std::size_t worth_counting = 64; // below, insertion beats counters for 256 digits
    if (items.size() < worth_counting) {
        for (std::size_t i = 1; i < items.size(); ++i) {
            const CodedIndex item = items[i];
            std::size_t place = i;
            for (; place > 0 && item.code < items[place - 1].code; --place) items[place] = items[place - 1];
            items[place] = item;
        }
        return;
    }
    std::uint64_t differing = 0;
    for (const CodedIndex& item : items) differing |= item.code ^ items[0].code;
    std::span<CodedIndex> from = items, to = scratch;
    for (int shift = 0; shift < 64; shift += 8) {
        if ((differing >> shift & 0xff) == 0) continue;
        std::array<std::size_t, 256> next{};
        for (const CodedIndex& item : from) ++next[item.code >> shift & 0xff];
        std::size_t sum = 0;
        for (std::size_t& n : next) sum += std::exchange(n, sum);
        for (const CodedIndex& item : from) to[next[item.code >> shift & 0xff]++] = item;
        std::swap(from, to);
    }
    if (from.data() != items.data()) std::copy(from.begin(), from.end(), items.begin());
}

} // namespace unseen::vdtree
