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

template <class F>
void ComponentMerger::for_each_component(Index cluster, F&& f) const {
    if (live_.is_simple(cluster)) {
        const float *references = live_.references.data() + cluster * channels_,
                    *quadric = live_.quadrics.data() + cluster * stride_;
        for (Index k = 0; k < classes_.count; ++k)
            f(k, View{k, references + first_channel_[k], quadric + first_float_[k]});
    } else {
        const auto [first, count] = live_.several[cluster];
        const ClassComponent* components = live_.components.data() + first;
        for (Index i = 0; i < count; ++i)
            f(i, View{components[i].attribute_class, components[i].references.data(), components[i].block.data()});
    }
}

namespace {

// A channel's row is a register.
UNSEEN_INLINE Float4 load_row(const float* row) {
    Float4 loaded;
    std::memcpy(&loaded, row, sizeof(loaded));
    return loaded;
}
UNSEEN_INLINE void store_row(const Float4& row, float* to) { std::memcpy(to, &row, sizeof(row)); }

// A row with this in the place of d, else 0.
UNSEEN_INLINE Float4 as_d(const Float4& first) { return __builtin_shufflevector(Float4{}, first, 0, 1, 2, 4); }

UNSEEN_INLINE Float4 moved(const Float4& row, const Float4& offset) {
    using namespace quadric;
    const Float4 along = row * offset;
    return row - as_d(along + __builtin_shufflevector(along, along, gy, gy, gy, gy) +
                      __builtin_shufflevector(along, along, gz, gz, gz, gz));
}

} // namespace

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
    add_base(live_.quadrics.data() + pair.a * stride_, live_.quadrics.data() + pair.b * stride_,
             Offset<float>{d.x, d.y, d.z}, base_.data());
    numbers_.resize(of_a + of_b);
    if (components_.size() < numbers_.size()) components_.resize(numbers_.size());
    count_ = 0;
    for_each_component(pair.a, [&](Index i, const View& from) UNSEEN_INLINE_LAMBDA {
        const Index root = root_of(i);
        if (root != i) return add(from, Float4{}, components_[numbers_[i] = numbers_[root]]);
        numbers_[i] = static_cast<Index>(count_);
        copy(from, [](const Float4& row) UNSEEN_INLINE_LAMBDA { return row; });
    });
    const Float4 offset{d.x, d.y, d.z};
    for_each_component(pair.b, [&](Index i, const View& from) UNSEEN_INLINE_LAMBDA {
        const Index number = of_a + i, root = root_of(number);
        if (root != number) return add(from, offset, components_[numbers_[number] = numbers_[root]]);
        numbers_[number] = static_cast<Index>(count_);
        copy(from, [&](const Float4& row) UNSEEN_INLINE_LAMBDA { return moved(row, offset); });
    });
}

// As add_block(). What is beside a row in the base is a register, too.
UNSEEN_INLINE void ComponentMerger::add(const View& from, const Float4& offset, ClassComponent& onto) {
    const std::size_t channels = classes_.channels[from.attribute_class];
    const float weight = from.block[channels * quadric::row_size];
    Float4 linear = load_row(base_.data() + quadric::hx);
    float* sum = onto.block.data();
    for (std::size_t c = 0; c < channels; ++c, sum += quadric::row_size) {
        const float step = from.references[c] - onto.references[c];
        const Float4 row = moved(load_row(from.block + c * quadric::row_size), offset),
                     raised = as_d(Float4{step * weight});
        linear += step * (row * Float4{1, 1, 1, 2} + raised);
        store_row(load_row(sum) + (row + raised), sum);
    }
    store_row(linear, base_.data() + quadric::hx);
    *sum += weight;
}

// `move`: of a row.
template <class Move>
UNSEEN_INLINE void ComponentMerger::copy(const View& from, Move&& move) {
    const std::size_t channels = std::min<std::size_t>(classes_.channels[from.attribute_class], most_class_channels);
    ClassComponent& made = components_[count_++];
    made.attribute_class = from.attribute_class;
    float* row = made.block.data();
    for (std::size_t c = 0; c < channels; ++c, row += quadric::row_size) {
        made.references[c] = from.references[c];
        store_row(move(load_row(from.block + c * quadric::row_size)), row);
    }
    *row = from.block[channels * quadric::row_size];
}

// Each row of the form's matrix, with what is beside it, is a register.
Form<float> ComponentMerger::form() const {
    using namespace quadric;
    const auto& q = base_;
    Float4 x{q[xx], q[xy], q[xz], q[hx]}, y{q[xy], q[yy], q[yz], q[hy]}, z{q[xz], q[yz], q[zz], q[hz]},
        rest{q[hx], q[hy], q[hz], q[k]};
    for (const ClassComponent& c : std::span(components_).first(count_)) {
        const std::size_t channels = classes_.channels[c.attribute_class];
        const float inverse = 1 / c.block[channels * row_size];
        for (std::size_t channel = 0; channel < channels; ++channel) {
            const Float4 row = load_row(c.block.data() + channel * row_size), scaled = row * inverse;
            x -= scaled[gx] * row, y -= scaled[gy] * row, z -= scaled[gz] * row, rest -= scaled[d] * row;
        }
    }
    return {x[0], x[1], x[2], y[1], y[2], z[2], x[3], y[3], z[3], rest[3]};
}

} // namespace unseen::vdtree
