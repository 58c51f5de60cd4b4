// Octree clustering: the vertices' cells in a tree of cubes, without the cubes that do not split anything.
//
// A vertex's path down the tree is its Morton code, so sorted codes are the tree: two neighbours part at the first
// digit in which they differ. The codes are first dealt into buckets by their leading digits; each bucket is sorted and
// made a subtree by itself, in parallel, and the subtrees are joined by the digits that tell the buckets apart.
#include <unseen/vdtree/builder.h>

#include <bit>

#include <unseen/vdtree/internal/parallel.h>

#include "build/parallel_array.h"
#include "build/progress_counter.h"
#include "build/spatial_order.h"

namespace unseen::vdtree {

namespace {

constexpr int digit_bits = 3;
constexpr int code_bits = digit_bits * morton_bits;

// One that was there before (of a bucket: a vertex), or their count + the number of one made in the same subtree.
using ClusterRef = Index;

// The clusters of one bucket, or those above the buckets.
class Subtree {
public:
    // `parents`: of the clusters that are there already; those that are joined here get the number of the one made from
    // them.
    Subtree(std::span<const glm::dvec3> positions, std::span<Index> parents)
        : positions_(positions), parents_(parents) {}

    // Items of distinct vertices, with their codes in a grid over all of them. Leaves the same vertices in another
    // order.
    ClusterRef build(std::span<CodedIndex> items, std::span<CodedIndex> scratch) {
        sort_by_code(items, scratch);
        const auto same_cell = [](const CodedIndex& a, const CodedIndex& b) { return a.code == b.code; };
        if (std::adjacent_find(items.begin(), items.end(), same_cell) == items.end()) return join_by_prefix(items);
        std::vector<CodedIndex> cells;
        for (std::size_t begin = 0; begin < items.size();) {
            std::size_t end = begin + 1;
            while (end < items.size() && same_cell(items[begin], items[end])) ++end;
            const std::uint64_t code = items[begin].code;
            cells.push_back({code, end - begin == 1 ? items[begin].index
                                                    : build_cell(items.subspan(begin, end - begin),
                                                                 scratch.subspan(begin, end - begin))});
            begin = end;
        }
        return join_by_prefix(cells);
    }

    // Joins clusters with distinct, sorted codes.
    ClusterRef join_by_prefix(std::span<const CodedIndex> items) {
        struct OpenNode {
            int level; // digits that its children share
            std::size_t first_child;
        };
        std::vector<OpenNode> open;
        std::vector<ClusterRef> children; // of the open nodes, one after another
        for (std::size_t i = 0; i < items.size(); ++i) {
            children.push_back(items[i].index);
            const int level = i + 1 < items.size() ? shared_digits(items[i].code, items[i + 1].code) : -1;
            while (!open.empty() && open.back().level > level) {
                const ClusterRef parent = join(std::span(children).subspan(open.back().first_child));
                children.resize(open.back().first_child);
                children.push_back(parent);
                open.pop_back();
            }
            if (level >= 0 && (open.empty() || open.back().level < level)) open.push_back({level, children.size() - 1});
        }
        return children[0];
    }

    std::vector<Index> parents_made; // by cluster made here: the number of its parent, also made here

private:
    static int shared_digits(std::uint64_t a, std::uint64_t b) {
        return (std::countl_zero(a ^ b) - (64 - code_bits)) / digit_bits;
    }

    // Vertices in one cell of the grid: they coincide, or they get a finer grid of their own. A grid tells the two
    // points that are farthest apart along some axis from each other, and each is 2^21 times finer than the last, so
    // that this ends within a hundred grids, where doubles end.
    ClusterRef build_cell(std::span<CodedIndex> items, std::span<CodedIndex> scratch) {
        const Box box = box_around(items, [&](const CodedIndex& item) { return positions_[item.index]; });
        if (!(box.extent() > 0)) {
            std::vector<ClusterRef> vertices;
            for (const CodedIndex& item : items) vertices.push_back(item.index);
            return join(vertices);
        }
        const MortonGrid grid(box);
        for (CodedIndex& item : items) item.code = grid.code(positions_[item.index]);
        return build(items, scratch);
    }

    ClusterRef join(std::span<const ClusterRef> children) {
        const Index there = static_cast<Index>(parents_.size()), number = static_cast<Index>(parents_made.size());
        parents_made.push_back(number);
        for (const ClusterRef child : children)
            (child < there ? parents_[child] : parents_made[child - there]) = number;
        return there + number;
    }

    std::span<const glm::dvec3> positions_;
    std::span<Index> parents_;
};

class Octree {
public:
    Octree(const ClusterInput& input, const Progress& progress)
        : positions_(input.mesh.positions), counter_(progress, positions_.size()) {}

    Result<Clustering> build() {
        counter_.add(0);
        result_.parents.resize(positions_.size());
        deal();
        if (!counter_.stopped()) build_subtrees();
        if (counter_.stopped()) return Error{ErrorCode::cancelled, "Building the octree was cancelled."};
        number();
        return std::move(result_);
    }

private:
    static constexpr std::size_t chunk_size = 1 << 15; // vertices that one thread codes and deals at a time
    static constexpr int most_bucket_digits = 5;       // each chunk has a counter for each bucket
    static constexpr std::size_t bucket_size = 1 << 6; // vertices of a bucket, if they fill space; more on surfaces

    template <class F>
    void for_each_chunk(F&& f) const {
        const std::size_t n = positions_.size(), chunks = (n + chunk_size - 1) / chunk_size;
        parallel_loop(std::size_t{0}, chunks,
                      [&](std::size_t chunk) { f(chunk, chunk * chunk_size, std::min(n, (chunk + 1) * chunk_size)); });
    }

    // Codes the vertices and sorts them into buckets by their first digits; the order within a bucket is the vertices'.
    void deal() {
        const std::size_t n = positions_.size();
        int digits = 0;
        while (digits < most_bucket_digits && bucket_size << (digit_bits * (digits + 1)) <= n) ++digits;
        const int shift = code_bits - digit_bits * digits;
        const std::size_t buckets = std::size_t{1} << (digit_bits * digits);
        const std::size_t chunks = (n + chunk_size - 1) / chunk_size;
        const Box box = box_around(positions_);
        const MortonGrid grid(box.low + (box.size() - box.extent()) * 0.5, box.extent()); // the cube around it
        ParallelArray<CodedIndex> coded(n, Unfilled());
        std::vector<Index> next(chunks * buckets, 0);
        for_each_chunk([&](std::size_t chunk, std::size_t begin, std::size_t end) {
            for (std::size_t v = begin; v < end; ++v) {
                coded[v] = {grid.code(positions_[v]), static_cast<Index>(v)};
                ++next[chunk * buckets + (coded[v].code >> shift)];
            }
        });
        Index sum = 0;
        for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
            if (bucket_begin_.empty() || sum != bucket_begin_.back()) bucket_begin_.push_back(sum);
            for (std::size_t chunk = 0; chunk < chunks; ++chunk)
                sum += std::exchange(next[chunk * buckets + bucket], sum);
        }
        if (sum != bucket_begin_.back()) bucket_begin_.push_back(sum);
        items_ = ParallelArray<CodedIndex>(n, Unfilled());
        for_each_chunk([&](std::size_t chunk, std::size_t begin, std::size_t end) {
            for (std::size_t v = begin; v < end; ++v)
                items_[next[chunk * buckets + (coded[v].code >> shift)]++] = coded[v];
        });
        scratch_ = std::move(coded);
        bucket_shift_ = shift;
    }

    std::size_t bucket_count() const { return bucket_begin_.size() - 1; }
    std::span<CodedIndex> of_bucket(std::span<CodedIndex> items, std::size_t b) const {
        return items.subspan(bucket_begin_[b], bucket_begin_[b + 1] - bucket_begin_[b]);
    }

    void build_subtrees() {
        subtrees_.assign(bucket_count(), Subtree(positions_, result_.parents));
        roots_.resize(bucket_count());
        parallel_loop_over(tbb::blocked_range<std::size_t>(0, bucket_count(), 16), [&](const auto& range) {
            if (counter_.stopped()) return;
            for (std::size_t b = range.begin(); b < range.end(); ++b) {
                const std::span<CodedIndex> items = of_bucket(items_, b);
                const std::uint64_t code = items[0].code >> bucket_shift_ << bucket_shift_;
                roots_[b] = {code, subtrees_[b].build(items, of_bucket(scratch_, b))};
            }
            counter_.add(bucket_begin_[range.end()] - bucket_begin_[range.begin()]);
        });
    }

    // Numbers the buckets' clusters one bucket after another, then joins the buckets' roots.
    void number() {
        const Index vertices = static_cast<Index>(positions_.size());
        std::vector<Index> first(bucket_count() + 1, vertices);
        for (std::size_t b = 0; b < bucket_count(); ++b)
            first[b + 1] = first[b] + static_cast<Index>(subtrees_[b].parents_made.size());
        std::vector<Index>& parents = result_.parents;
        parents.reserve(first.back() + bucket_count());
        parents.resize(first.back());
        parallel_loop(std::size_t{0}, bucket_count(), [&](std::size_t b) {
            const std::vector<Index>& made = subtrees_[b].parents_made;
            for (std::size_t i = 0; i < made.size(); ++i) parents[first[b] + i] = first[b] + made[i];
            for (const CodedIndex& item : of_bucket(items_, b)) parents[item.index] += first[b];
            if (roots_[b].index >= vertices) roots_[b].index += first[b] - vertices;
        });
        if (bucket_count() == 1) return;
        Subtree above(positions_, parents);
        above.join_by_prefix(roots_);
        for (const CodedIndex& root : roots_) parents[root.index] += first.back();
        for (const Index parent : above.parents_made) parents.push_back(first.back() + parent);
    }

    std::span<const glm::dvec3> positions_;
    ProgressCounter counter_;
    Clustering result_;
    int bucket_shift_ = 0;
    ParallelArray<CodedIndex> items_, scratch_; // by bucket
    std::vector<Index> bucket_begin_;           // of buckets that are not empty; one longer
    std::vector<Subtree> subtrees_;
    std::vector<CodedIndex> roots_; // by bucket
};

} // namespace

Result<Clustering> cluster_octree(const ClusterInput& input, const Progress& progress) {
    return Octree(input, progress).build();
}

} // namespace unseen::vdtree
