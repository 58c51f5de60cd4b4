// Deadlines, a block of watched slots a lane or a slot a lane: see deadline_kernel.h.

// The eye has moved by `path`. Seen from a point of the sphere, it has turned by that over the mean distance at most;
// the distances of the point and of the centre change alike but for that angle times the way between them.
UNSEEN_INLINE Floats error_of(const Floats& before, const Floats& after, const Floats& radius, float path) {
    const Floats between = before + after - 2 * radius, turned = 2 * path * radius / between;
    const Floats most = Floats{} + 2 * path;
    return ((between > 0) & (turned < most)) ? turned : most;
}

UNSEEN_INLINE void move_all(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) {
    const auto move = [&](const float* x, const float* y, const float* z, const float* r, float* distance,
                          float* error) UNSEEN_INLINE_LAMBDA {
        const Floats ex = (eye_high[0] - load(x)) + eye_low[0], ey = (eye_high[1] - load(y)) + eye_low[1],
                     ez = (eye_high[2] - load(z)) + eye_low[2];
        const Floats after = root_of(ex * ex + ey * ey + ez * ez);
        const Floats more = error_of(load(distance), after, load(r), path);
        constexpr float up = 1 + 5e-7f; // small steps must not be lost in the sum's rounding
        store(error, (load(error) + more) * up);
        store(distance, after);
    };
    const std::size_t count = spheres.x.size();
    std::size_t i = 0;
    for (; i + width <= count; i += width)
        move(&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], &spheres.distance[i], &spheres.error[i]);
    if (i == count) return;
    float rest[6][width] = {};
    std::vector<float>* const values[6] = {&spheres.x,      &spheres.y,        &spheres.z,
                                           &spheres.radius, &spheres.distance, &spheres.error};
    for (std::size_t v = 0; v < 6; ++v)
        std::copy(values[v]->begin() + static_cast<std::ptrdiff_t>(i), values[v]->end(), rest[v]);
    move(rest[0], rest[1], rest[2], rest[3], rest[4], rest[5]);
    for (std::size_t v = 4; v < 6; ++v)
        std::copy_n(rest[v], count - i, values[v]->begin() + static_cast<std::ptrdiff_t>(i));
}

UNSEEN_INLINE void defer_inside(const KernelView& view, float margin, const KernelClock& clock,
                                const BlockSpheres& spheres, float* deadlines) {
    const auto keep = [&](const float* x, const float* y, const float* z, const float* radius,
                          float* deadline) UNSEEN_INLINE_LAMBDA {
        const Floats before = load(deadline);
        if (!any(before <= clock.late)) return;
        const Floats to_eye[3] = {(view.eye_high[0] - load(x)) + view.eye_low[0],
                                  (view.eye_high[1] - load(y)) + view.eye_low[1],
                                  (view.eye_high[2] - load(z)) + view.eye_low[2]};
        const Floats slack = height(view, to_eye) - load(radius) - margin;
        store(deadline, ((before <= clock.late) & (slack > 0)) ? (clock.early + slack) * just_less : before);
    };
    const std::size_t count = spheres.x.size();
    std::size_t i = 0;
    for (; i + width <= count; i += width)
        keep(&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], deadlines + i);
    if (i == count) return;
    float rest[5][width] = {};
    const float* const values[5] = {&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], deadlines + i};
    for (std::size_t v = 0; v < 5; ++v) std::copy_n(values[v], count - i, rest[v]);
    keep(rest[0], rest[1], rest[2], rest[3], rest[4]);
    std::copy_n(rest[4], count - i, deadlines + i);
}

UNSEEN_INLINE std::size_t look_at(std::span<const std::uint32_t> which, float position_clock, float facing_clock,
                                  const SlotDeadlines* dues, const std::uint16_t* unfolded, const BlockSpheres& spheres,
                                  EarliestDeadlines& deadlines, std::uint32_t* due) {
    const Floats never = all(std::numeric_limits<float>::infinity());
    constexpr std::uint32_t none_due = 1u << block_slots; // keeps a count of zeros defined
    std::size_t count = 0;
    for (std::size_t at = 0; at < which.size(); ++at) {
        constexpr std::size_t ahead = 40; // blocks between a prefetch and its use
        if (at + ahead < which.size()) {
            prefetch(dues[which[at + ahead]].position);
            prefetch(dues[which[at + ahead]].facing);
        }
        const std::uint32_t block = which[at];
        const float passed = spheres.error[block] + position_clock;
        const Floats recede = all(passed + spheres.distance[block]), approach = all(passed - spheres.distance[block]);
        Floats next_recede = never, next_approach = never, next_facing = never;
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < block_slots; i += width) {
            const Floats position = load(dues[block].position + i), facing = load(dues[block].facing + i);
            const Ints recedes = mask_of(unfolded[block], i);
            const Ints is_due = (position <= (recedes ? recede : approach)) | (facing <= facing_clock);
            bits |= bits_of(is_due) << i;
            next_recede = min_of(next_recede, ~is_due & recedes ? position : never);
            next_approach = min_of(next_approach, is_due | recedes ? never : position);
            next_facing = min_of(next_facing, is_due ? never : facing);
        }
        deadlines.set(block, least_of(next_recede), least_of(next_approach), least_of(next_facing));
        // The number of due slots is unpredictable, so branch-free: a few places are always written, and the next block
        // overwrites the surplus.
        const std::uint32_t first = block * static_cast<std::uint32_t>(block_slots);
        std::uint32_t* const next = due + count;
        count += static_cast<std::size_t>(std::popcount(bits));
        constexpr std::size_t mostly = 4;
        for (std::size_t i = 0; i < mostly; ++i, bits &= bits - 1)
            next[i] = first + static_cast<std::uint32_t>(std::countr_zero(bits | none_due));
        for (std::size_t i = mostly; bits; ++i, bits &= bits - 1)
            next[i] = first + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
    return count;
}

UNSEEN_INLINE void deadlines_of(const TestBatch& tested, DeadlineBatch& dues) {
    const Floats none = all(0);
    for (std::size_t i = 0; i < kernel_lanes; i += width) {
        const auto unfolded = mask_of(tested.unfolded, i);
        const Floats passed = load(dues.passed + i), distance = load(dues.distance + i);
        const Floats margin = unfolded ? all(dues.margin) : none;
        const Floats left = max_of(min_of(all(dues.longest), load(tested.position_slack + i)) - margin, none);
        const Floats slack = left - sum_rounding * (passed + distance + min_of(left, distance));
        store(dues.position + i, passed + slack + (unfolded ? distance : -distance));
        store(dues.facing + i, (dues.facing_clock + max_of(load(tested.facing_slack + i) - margin, none)) * just_less);
    }
}

UNSEEN_INLINE void due_blocks_of(float position, float facing, const BlockSpheres& spheres,
                                 const EarliestDeadlines& deadlines, std::uint64_t* due) {
    const std::size_t count = spheres.x.size();
    for (std::size_t first = 0; first < count; first += 64) {
        std::uint64_t bits = 0;
        const std::size_t end = std::min(first + 64, count);
        std::size_t i = first;
        for (; i + width <= end; i += width) {
            const auto distance = load(&spheres.distance[i]), passed = load(&spheres.error[i]) + position;
            const auto is_due = (load(&deadlines.recede[i]) <= passed + distance) |
                                (load(&deadlines.approach[i]) <= passed - distance) |
                                (load(&deadlines.facing[i]) <= facing);
            bits |= std::uint64_t{bits_of(is_due)} << (i - first);
        }
        for (; i < end; ++i) {
            const float distance = spheres.distance[i], passed = spheres.error[i] + position;
            const bool is_due = deadlines.recede[i] <= passed + distance ||
                                deadlines.approach[i] <= passed - distance || deadlines.facing[i] <= facing;
            bits |= std::uint64_t{is_due} << (i - first);
        }
        due[first / 64] = bits;
    }
}
