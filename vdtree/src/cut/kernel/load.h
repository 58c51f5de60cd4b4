// From the arrays of a tree, and from records of nodes, to registers.

template <class Of>
UNSEEN_INLINE void load_sphere(Of sphere_of, Nodes& nodes) {
    static_assert(sizeof(Sphere) == sizeof(float) * 4);
    Floats columns[4];
    Vectors::load_columns(sphere_of, columns);
    for (int k = 0; k < 3; ++k) nodes.centre[k] = columns[k];
    nodes.radius = columns[3];
}
template <class At>
UNSEEN_INLINE Floats load_values(const float* from, At at) {
    return collect<Floats>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return from[at(lane)]; });
}

UNSEEN_INLINE Floats reach_of(const KernelView& view, const Ints& octaves) {
    return octaves > 0 ? view.reach * reinterpret_cast<Floats>((octaves + (127 - 63)) << 23) : all(0);
}

// `at(lane)` is a lane's node.
template <class At>
UNSEEN_INLINE Nodes load_nodes(const KernelView& view, const NodeArrays& arrays, At at) {
    Nodes nodes;
    if (arrays.support)
        load_sphere([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.support[at(lane)]; }, nodes);
    else load_sphere([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].ring; }, nodes);
    nodes.length = arrays.lengths ? load_values(arrays.lengths, at) : nodes.radius;
    nodes.silhouette_length = arrays.silhouette_lengths ? load_values(arrays.silhouette_lengths, at) : nodes.length;
    nodes.radius += view.spread; // the lengths are those of the node itself
    nodes.reach = all(0);
    if (arrays.reach)
        nodes.reach = reach_of(view, collect<Ints>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA {
                                   return static_cast<std::int32_t>(arrays.reach[at(lane)]);
                               }));
    nodes.interior_row = nodes.silhouette_row = Ints{};
    if (arrays.classes) {
        nodes.interior_row = collect<Ints>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA {
            return static_cast<std::int32_t>(arrays.classes[at(lane)].interior);
        });
        nodes.silhouette_row = collect<Ints>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA {
            return static_cast<std::int32_t>(arrays.classes[at(lane)].silhouette);
        });
    }
    return nodes;
}

struct Candidates {
    Nodes nodes;
    Floats ring[3], ring_radius;
    Words words;
};

template <class At>
UNSEEN_INLINE Candidates load_candidates(const KernelView& view, At at) {
    static_assert(offsetof(FoldCandidate, length) == 16 && offsetof(FoldCandidate, rows) == 24 &&
                  offsetof(FoldCandidate, ring) == 28 && offsetof(FoldCandidate, slabs) == 44 &&
                  offsetof(FoldCandidate, flags) == 58);
    static_assert(sizeof(FoldClass) == 4 && offsetof(FoldClass, interior) == 0 &&
                  std::endian::native == std::endian::little);
    Floats c[16];
    for (std::size_t quarter = 0; quarter < 4; ++quarter)
        Vectors::load_columns(
            [&](std::size_t lane)
                UNSEEN_INLINE_LAMBDA { return reinterpret_cast<const std::byte*>(at(lane)) + 16 * quarter; },
            c + 4 * quarter);
    const auto bits = [&](std::size_t column) UNSEEN_INLINE_LAMBDA { return reinterpret_cast<Ints>(c[column]); };
    const Ints interior_row = bits(6) & 0xffff, silhouette_row = (bits(6) >> 16) & 0xffff;
    const Floats reach = reach_of(view, (bits(14) >> 18) & 63);
    return {{{c[0], c[1], c[2]}, c[3] + view.spread, c[4], c[5], reach, interior_row, silhouette_row},
            {c[7], c[8], c[9]},
            c[10] + view.spread,
            {{bits(11), bits(12), bits(13), bits(14)}}};
}

UNSEEN_INLINE void prefetch_node(const NodeArrays& arrays, NodeId node) {
    prefetch(arrays.bounds + node);
    if (arrays.support) prefetch(arrays.support + node);
    if (arrays.classes) prefetch(arrays.classes + node);
    if (arrays.facing) prefetch(arrays.facing + node);
    if (arrays.lengths) prefetch(arrays.lengths + node);
    if (arrays.silhouette_lengths) prefetch(arrays.silhouette_lengths + node);
    if (arrays.reach) prefetch(arrays.reach + node);
}

// Nodes by their places in a list; beyond its end the last one again.
struct Listed {
    const NodeArrays& arrays;
    const NodeId* nodes;
    std::size_t last;
    UNSEEN_INLINE NodeId operator()(std::size_t i) const { return nodes[std::min(i, last)]; }
    UNSEEN_INLINE void prefetch(std::size_t i) const {
        constexpr std::size_t ahead = 64; // nodes between a prefetch and its use
        for (std::size_t lane = 0; lane < width; ++lane) prefetch_node(arrays, (*this)(i + ahead + lane));
    }
};
