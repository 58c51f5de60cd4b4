#include "build/component_merger.h"

#include <numeric>

namespace unseen::vdtree {

ComponentMerger::ComponentMerger(const LiveClusters& live, const AttributeClasses& classes)
    : live_(live), classes_(classes), channels_(classes.total_channels()), stride_(classes.stride()) {
    for (std::size_t k = 0; k < classes.count; ++k) {
        first_channel_[k] = classes.first_channel(k);
        first_float_[k] = classes.first_float(k);
    }
}

Index ComponentMerger::root_of(Index number) {
    while (joined_to_[number] != number) number = joined_to_[number] = joined_to_[joined_to_[number]];
    return number;
}

// Roots have the lowest number, so a component of each class stays first, in its class's place.
void ComponentMerger::unite(ClusterPair pair, std::span<const Link> links) {
    const Index of_a = count(pair.a), of_b = count(pair.b);
    joined_to_.resize(of_a + of_b);
    std::iota(joined_to_.begin(), joined_to_.end(), Index{0});
    for (const Link& link : links) {
        const Index x = root_of(link.a), y = root_of(of_a + link.b);
        joined_to_[std::max(x, y)] = std::min(x, y);
    }
    const glm::vec3 d(live_.places[pair.b] - live_.places[pair.a]);
    const Offset<float> to{d.x, d.y, d.z};
    add_base(live_.quadrics.data() + pair.a * stride_, live_.quadrics.data() + pair.b * stride_, to, base_.data());
    numbers_.resize(of_a + of_b);
    count_ = 0;
    for (Index i = 0; i < of_a; ++i) add(component(pair.a, i), {0, 0, 0}, i, root_of(i));
    for (Index i = 0; i < of_b; ++i) add(component(pair.b, i), to, of_a + i, root_of(of_a + i));
}

// Its place lies at `to`.
void ComponentMerger::add(const View& from, const Offset<float>& to, Index number, Index root) {
    if (root == number) {
        numbers_[number] = static_cast<Index>(count_);
        return copy(from, to);
    }
    const std::size_t channels = classes_.channels[from.attribute_class];
    ClassComponent& onto = components_[numbers_[number] = numbers_[root]];
    // As add_block(), with a row, and what is beside it in the base, in a register.
    const Float4 offset{to.x, to.y, to.z};
    const float weight = from.block[channels * quadric::row_size];
    Float4 linear;
    std::memcpy(&linear, base_.data() + quadric::hx, sizeof(linear));
    for (std::size_t c = 0; c < channels; ++c) {
        const float step = from.references[c] - onto.references[c];
        Float4 row, sum;
        std::memcpy(&row, from.block + c * quadric::row_size, sizeof(row));
        std::memcpy(&sum, onto.block.data() + c * quadric::row_size, sizeof(sum));
        const Float4 along = row * offset;
        const float moved = row[quadric::d] - (along[quadric::gx] + along[quadric::gy] + along[quadric::gz]);
        row[quadric::d] = 2 * moved + step * weight;
        linear += step * row;
        row[quadric::d] = moved + step * weight;
        sum += row;
        std::memcpy(onto.block.data() + c * quadric::row_size, &sum, sizeof(sum));
    }
    std::memcpy(base_.data() + quadric::hx, &linear, sizeof(linear));
    onto.block[channels * quadric::row_size] += weight;
}

void ComponentMerger::copy(const View& from, const Offset<float>& to) {
    const std::size_t channels = classes_.channels[from.attribute_class];
    if (count_ == components_.size()) components_.emplace_back();
    ClassComponent& made = components_[count_++];
    made.attribute_class = from.attribute_class;
    // A row is a register.
    const Float4 offset{to.x, to.y, to.z};
    for (std::size_t c = 0; c < channels; ++c) {
        made.references[c] = from.references[c];
        Float4 row;
        std::memcpy(&row, from.block + c * quadric::row_size, sizeof(row));
        const Float4 along = row * offset;
        row[quadric::d] -= along[quadric::gx] + along[quadric::gy] + along[quadric::gz];
        std::memcpy(made.block.data() + c * quadric::row_size, &row, sizeof(row));
    }
    made.block[channels * quadric::row_size] = from.block[channels * quadric::row_size];
}

// A row is a register, and so is each row of the form's matrix with what is beside it.
Form<float> ComponentMerger::form() const {
    using namespace quadric;
    const auto& q = base_;
    Float4 x{q[xx], q[xy], q[xz], q[hx]}, y{q[xy], q[yy], q[yz], q[hy]}, z{q[xz], q[yz], q[zz], q[hz]},
        rest{q[hx], q[hy], q[hz], q[k]};
    for (std::size_t i = 0; i < count_; ++i) {
        const ClassComponent& c = components_[i];
        const std::size_t channels = classes_.channels[c.attribute_class];
        const float inverse = 1 / c.block[channels * row_size];
        for (std::size_t channel = 0; channel < channels; ++channel) {
            Float4 row;
            std::memcpy(&row, c.block.data() + channel * row_size, sizeof(row));
            const Float4 scaled = row * inverse;
            x -= scaled[gx] * row, y -= scaled[gy] * row, z -= scaled[gz] * row, rest -= scaled[d] * row;
        }
    }
    return {x[0], x[1], x[2], y[1], y[2], z[2], x[3], y[3], z[3], rest[3]};
}

} // namespace unseen::vdtree
