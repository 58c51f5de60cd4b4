// Deadlines, a block of watched slots a lane or a slot a lane: see deadline_kernel.h.

// The eye has moved by `path`. Seen from a point of the sphere, it has turned by that over the mean distance at most;
// the distances of the point and of the centre change alike but for that angle times the way between them.
UNSEEN_INLINE Floats error_of(const Floats& before, const Floats& after, const Floats& radius, float path) {
    const Floats between = before + after - 2 * radius, turned = 2 * path * radius / between;
    const Floats most = Floats{} + 2 * path;
    return ((between > 0) & (turned < most)) ? turned : most;
}

void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockArrays& blocks) noexcept {
    for (std::size_t i = 0; i < blocks.x.size(); i += width) {
        const Floats ex = (eye_high[0] - load(&blocks.x[i])) + eye_low[0],
                     ey = (eye_high[1] - load(&blocks.y[i])) + eye_low[1],
                     ez = (eye_high[2] - load(&blocks.z[i])) + eye_low[2];
        const Floats after = root_of(ex * ex + ey * ey + ez * ez);
        const Floats more = error_of(load(&blocks.distance[i]), after, load(&blocks.radius[i]), path);
        constexpr float up = 1 + 5e-7f; // small steps must not be lost in the sum's rounding
        store(&blocks.error[i], (load(&blocks.error[i]) + more) * up);
        store(&blocks.distance[i], after);
    }
}

// Let p and q be points as far apart as the radius r, seen from the eye before and after a motion, each turned so that the
// gaze is the same. While q goes a straight way of length s, at least D from the eye even for points r beside it, its angle
// from the gaze changes by its gradient, of length 1/D at most. Along p's way the gradient differs by r times the Hessian,
// whose norm is max(1, cot angle) / D^2; and p goes another way than q by the turn times r.
float turn_blocks(const GazeMotion& motion, const BlockArrays& spheres, GazeArrays& blocks,
                  std::uint64_t* due) noexcept {
    constexpr float full_turn = 2 * pi;    // no two angles change less alike than that
    constexpr float up = 1 + 5e-7f;        // small steps must not be lost in the sum's rounding
    constexpr float angle_inexact = 4e-6f; // of two angles, and of the turned gaze
    const Floats none = all(never_due);
    Floats largest{};
    for (std::size_t first = 0; first < spheres.x.size(); first += 64) {
        std::uint64_t bits = 0;
        for (std::size_t i = first; i < std::min(first + 64, spheres.x.size()); i += width) {
            const Floats centre[3] = {load(&spheres.x[i]), load(&spheres.y[i]), load(&spheres.z[i])};
            Floats before[3], after[3];
            for (int k = 0; k < 3; ++k) {
                before[k] = (motion.from_high[k] - centre[k]) + motion.from_low[k];
                after[k] = (motion.to_high[k] - centre[k]) + motion.to_low[k];
            }
            Floats square_before{}, square_after{}, square_step{};
            for (int k = 0; k < 3; ++k) {
                const float(&row)[3] = motion.turn[k];
                const Floats step = (row[0] * after[0] + row[1] * after[1] + row[2] * after[2]) - before[k];
                square_before += before[k] * before[k], square_after += after[k] * after[k], square_step += step * step;
            }
            const Floats radius = load(&spheres.radius[i]), was = load(&blocks.angle[i]);
            const Floats far_after = root_of(square_after), nearest = min_of(root_of(square_before), far_after);
            const Floats step = root_of(square_step) + 1e-6f * nearest;
            const Floats room = max_of(nearest - 0.5f * step - radius, all(least_length)), inverse = 1 / room;
            const Floats angle = angle_from(motion.gaze, after, far_after);
            // The least angle from the gaze, or from its opposite, of any point on the way.
            const Floats least =
                min_of(min_of(was, angle), pi - max_of(was, angle)) - (step + pi / 2 * radius) * inverse;
            const Floats turned = motion.turned * radius * inverse;
            const Floats bend =
                (step * inverse) * (radius * inverse) * max_of(all(1), 1 / max_of(least, all(least_length)));
            const Floats more =
                min_of(min_of(least > 0 ? bend + turned : all(full_turn), 2 * step * inverse + turned), all(full_turn));
            const Floats error = (load(&blocks.error[i]) + more + angle_inexact) * up;
            store(&blocks.angle[i], angle);
            store(&blocks.error[i], error);
            const Floats outward = load(&blocks.outward[i]), inward = load(&blocks.inward[i]);
            const Ints is_due = (outward <= error + angle) | (inward <= error - angle);
            largest = min_of(outward, inward) < none ? max_of(largest, error) : largest;
            bits |= std::uint64_t{bits_of(is_due)} << (i - first);
        }
        due[first / 64] = bits;
    }
    return -least_of(-largest);
}

void keep_inside(const KernelView& view, float margin, const KernelClock& clock, const BlockArrays& blocks,
                 float* deadlines) noexcept {
    for (std::size_t i = 0; i < blocks.x.size(); i += width) {
        const Floats before = load(deadlines + i);
        if (!any(before <= clock.late)) continue;
        const Floats to_eye[3] = {(view.eye_high[0] - load(&blocks.x[i])) + view.eye_low[0],
                                  (view.eye_high[1] - load(&blocks.y[i])) + view.eye_low[1],
                                  (view.eye_high[2] - load(&blocks.z[i])) + view.eye_low[2]};
        const Floats slack = height(view, to_eye) - load(&blocks.radius[i]) - margin;
        store(deadlines + i, ((before <= clock.late) & (slack > 0)) ? (clock.early + slack) * just_less : before);
    }
}

std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock,
                           const SlotDeadlines* dues, const std::uint16_t* unfolded, BlockArrays& blocks,
                           std::uint32_t* due) noexcept {
    const Floats none = all(never_due);
    constexpr std::uint32_t none_due = 1u << block_slots; // keeps a count of zeros defined
    std::size_t count = 0;
    for (std::size_t at = 0; at < which.size(); ++at) {
        constexpr std::size_t ahead = 40; // blocks between a prefetch and its use
        if (at + ahead < which.size()) {
            prefetch(dues[which[at + ahead]].position);
            prefetch(dues[which[at + ahead]].facing);
        }
        const std::uint32_t block = which[at];
        const float passed = blocks.error[block] + position_clock;
        const Floats recede = all(passed + blocks.distance[block]), approach = all(passed - blocks.distance[block]);
        Floats next_recede = none, next_approach = none, next_facing = none;
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < block_slots; i += width) {
            const Floats position = load(dues[block].position + i), facing = load(dues[block].facing + i);
            const Ints recedes = mask_of(unfolded[block], i);
            const Ints is_due = (position <= (recedes ? recede : approach)) | (facing <= facing_clock);
            bits |= bits_of(is_due) << i;
            next_recede = min_of(next_recede, ~is_due & recedes ? position : none);
            next_approach = min_of(next_approach, is_due | recedes ? none : position);
            next_facing = min_of(next_facing, is_due ? none : facing);
        }
        blocks.set_earliest(block, least_of(next_recede), least_of(next_approach), least_of(next_facing));
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

void find_deadlines(const TestBatch& tested, DeadlineBatch& dues) noexcept {
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

bool hand_over(float clock_of_unfolded, float clock_of_folded, std::uint32_t unfolded, float* deadlines, float* facing,
               float& earliest_unfolded, float& earliest_folded) noexcept {
    const Floats none = all(never_due);
    Floats of_unfolded = none, of_folded = none;
    bool any_due = false;
    for (std::size_t i = 0; i < block_slots; i += width) {
        const Floats due = load(deadlines + i);
        const Ints unfolds = mask_of(unfolded, i);
        const Ints is_due = due <= (unfolds ? all(clock_of_unfolded) : all(clock_of_folded));
        any_due |= any(is_due);
        store(facing + i, is_due ? -none : load(facing + i));
        store(deadlines + i, is_due ? none : due);
        of_unfolded = min_of(of_unfolded, is_due | ~unfolds ? none : due);
        of_folded = min_of(of_folded, is_due | unfolds ? none : due);
    }
    earliest_unfolded = least_of(of_unfolded);
    earliest_folded = least_of(of_folded);
    return any_due;
}

void find_due_blocks(float position, float facing, const BlockArrays& blocks, std::uint64_t* due) noexcept {
    for (std::size_t first = 0; first < blocks.x.size(); first += 64) {
        std::uint64_t bits = 0;
        for (std::size_t i = first; i < std::min(first + 64, blocks.x.size()); i += width) {
            const auto distance = load(&blocks.distance[i]), passed = load(&blocks.error[i]) + position;
            const auto is_due = (load(&blocks.recede[i]) <= passed + distance) |
                                (load(&blocks.approach[i]) <= passed - distance) | (load(&blocks.facing[i]) <= facing);
            bits |= std::uint64_t{bits_of(is_due)} << (i - first);
        }
        due[first / 64] = bits;
    }
}
