// Puts two clusters together of which at least one has several components of an attribute class.
#pragma once

#include "build/quadric_contraction.h"

namespace unseen::vdtree {

class ComponentMerger {
public:
    ComponentMerger(const LiveClusters& live, const AttributeClasses& classes);

    // Relative to a's place. Components that are not linked stay as they are.
    void unite(ClusterPair pair, std::span<const Link> links);

    float* base() { return base_.data(); }
    std::span<ClassComponent> components() { return std::span(components_).first(count_); }
    // By component of a, then of b: its number in components().
    std::span<const Index> numbers() const { return numbers_; }
    // With the best values of every component.
    Form<float> form() const;

private:
    struct View {
        Index attribute_class;
        const float *references, *block;
    };
    Index count(Index cluster) const {
        return live_.is_simple(cluster) ? classes_.count : live_.several[cluster].count;
    }
    // Calls f(number, view) for each component.
    template <class F>
    UNSEEN_INLINE void for_each_component(Index cluster, F&& f) const;
    Index root_of(Index number);
    void add(const View& from, const Float4& offset, ClassComponent& onto);
    template <class Move>
    void copy(const View& from, Move&& move);

    const LiveClusters& live_;
    AttributeClasses classes_;
    std::size_t channels_, stride_;
    std::array<std::size_t, most_classes> first_channel_{}, first_float_{};
    std::array<float, quadric::base_size> base_{};
    std::vector<ClassComponent> components_; // the first count_; the others are there to be used again
    std::size_t count_ = 0;
    std::vector<Index> numbers_, joined_to_;
};

} // namespace unseen::vdtree
