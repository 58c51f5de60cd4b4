#include "kept_arrays.h"

#include <set>

#include "mesh_readers.h"
#include "restore.h"
#include "text_scanner.h"
#include "value_types.h"

namespace unseen::meshio {

namespace {

// Sums of a proxy's values, one component at a time.
class FiniteMean {
public:
    void add(double value) {
        if (!std::isfinite(value)) return;
        ++count_;
        sum_ += value;
        low_ = std::min(low_, value);
        high_ = std::max(high_, value);
    }
    bool is_there() const { return count_ > 0; }
    // Within the values, so that equal ones stay what they are. For sums beyond all numbers the middle has to do.
    double value() const {
        const double mean = std::isfinite(sum_) ? sum_ / static_cast<double>(count_) : low_ / 2 + high_ / 2;
        return std::clamp(mean, low_, high_);
    }

private:
    std::uint64_t count_ = 0;
    double sum_ = 0, low_ = std::numeric_limits<double>::infinity(), high_ = -low_;
};

class ArraysOfCut {
public:
    ArraysOfCut(const VertexTree& tree, const LeafRuns& leaves, const ExtractedMesh& extracted)
        : tree_(tree), leaves_(leaves), extracted_(extracted) {
        find_nearest();
    }

    VertexArray gather(const VertexArray& array) const {
        VertexArray out{array.name, array.type, array.components, array.role, {}};
        const std::size_t bytes = array.tuple_bytes();
        out.values.resize(nearest_.size() * bytes);
        for (std::size_t v = 0; v < nearest_.size(); ++v) {
            const Index first = leaves_.begin(extracted_.wedges[v]), end = leaves_.end(extracted_.wedges[v]);
            std::byte* const to = out.values.data() + v * bytes;
            std::memcpy(to, array.values.data() + nearest_[v] * bytes, bytes);
            if (end - first < 2 || is_integer(array.type)) continue;
            for (std::uint32_t c = 0; c < array.components; ++c) {
                FiniteMean mean;
                for (Index rank = first; rank < end; ++rank) mean.add(array.number(source(rank), c));
                if (!mean.is_there()) continue;
                if (array.type == ValueType::float64) store(to, c, mean.value());
                else store(to, c, static_cast<float>(mean.value()));
            }
        }
        return out;
    }

private:
    template <class T>
    static void store(std::byte* tuple, std::uint32_t component, T value) {
        std::memcpy(tuple + component * sizeof value, &value, sizeof value);
    }

    Index source(Index rank) const { return tree_.source_vertices()[leaves_.leaf(rank)]; }

    void find_nearest() {
        nearest_.resize(extracted_.wedges.size());
        for (std::size_t v = 0; v < nearest_.size(); ++v) {
            const WedgeId wedge = extracted_.wedges[v];
            const glm::dvec3 place(tree_.positions()[wedge]);
            double least = std::numeric_limits<double>::infinity();
            nearest_[v] = source(leaves_.begin(wedge));
            for (Index rank = leaves_.begin(wedge); rank < leaves_.end(wedge); ++rank) {
                const glm::vec3 leaf = tree_.positions()[tree_.wedge_of_leaf(leaves_.leaf(rank))];
                const glm::dvec3 apart = glm::dvec3(leaf) - place;
                const double distance = glm::dot(apart, apart);
                if (!(distance < least || (distance == least && source(rank) < nearest_[v]))) continue;
                least = distance;
                nearest_[v] = source(rank);
            }
        }
    }

    const VertexTree& tree_;
    const LeafRuns& leaves_;
    const ExtractedMesh& extracted_;
    std::vector<Index> nearest_; // by vertex of the cut: of the input's, the one that stands for it where one has to
};

} // namespace

void keep_arrays(ReadResult& result, std::vector<VertexArray> arrays) {
    std::set<std::string> names;
    std::vector<std::string> doubled;
    std::erase_if(arrays, [&](const VertexArray& array) {
        const bool is_new = names.insert(array.name).second;
        if (!is_new) doubled.push_back(array.name);
        return !is_new;
    });
    if (!doubled.empty())
        result.notes.push_back("of several arrays of one name the first was kept: " + listed(doubled) + ".");
    if (arrays.empty()) return;
    result.document = SourceDocument{.format = SourceDocument::Format::table, .arrays = std::move(arrays)};
}

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 6;
    std::string list;
    for (std::size_t i = 0; i < std::min(names.size(), most); ++i) {
        if (i > 0) list += i + 1 == names.size() ? " and " : ", ";
        list += in_quotes(names[i]);
    }
    return names.size() > most ? list + " and " + std::to_string(names.size() - most) + " more" : list;
}

std::vector<std::string> names_of(std::span<const VertexArray> arrays) {
    std::vector<std::string> names;
    for (const VertexArray& array : arrays)
        if (array.role == VertexArray::Role::value) names.push_back(array.name);
    return names;
}

bool is_colour_name(std::string_view name) {
    constexpr std::string_view usual[] = {"rgb", "rgba", "color", "colors", "colour", "colours"};
    return std::ranges::any_of(usual, [&](std::string_view one) { return equals_ignoring_case(name, one); });
}

Result<std::vector<VertexArray>> arrays_of_cut(const Cut& cut, const ExtractedMesh& extracted,
                                               std::span<const VertexArray> arrays) {
    std::size_t vertices = cut.tree().source_vertex_count();
    for (const VertexArray& array : arrays)
        if (array.role == VertexArray::Role::value && array.size() != vertices) vertices = array.size();
    const auto leaves = leaves_of_wedges(cut.tree(), vertices);
    if (!leaves) return leaves.error();
    const ArraysOfCut source(cut.tree(), *leaves, extracted);
    std::vector<VertexArray> out;
    for (const VertexArray& array : arrays)
        out.push_back(array.role == VertexArray::Role::value ? source.gather(array) : array);
    return out;
}

} // namespace unseen::meshio
