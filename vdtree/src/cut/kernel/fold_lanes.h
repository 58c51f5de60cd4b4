// The arithmetic of fold tests on registers of one kind: `Vectors`. For fold_kernel.cpp alone, which includes this once for each kind, in a
// namespace of its own and for processors that have it: GCC takes vectors apart that it meets in functions for others, even
// where these are inlined.

// The arithmetic on one register's lanes at once.
struct Lanes {
    using Floats = Vectors::Floats;
    using Ints = Vectors::Ints;
    static constexpr std::size_t width = sizeof(Floats) / sizeof(float);

    static UNSEEN_INLINE Floats min_of(const Floats& a, const Floats& b) { return a < b ? a : b; }
    static UNSEEN_INLINE Floats max_of(const Floats& a, const Floats& b) { return a > b ? a : b; }
    static UNSEEN_INLINE Floats abs_of(const Floats& a) { return max_of(a, -a); }
    static UNSEEN_INLINE Floats all(float a) { return Floats{} + a; }

    static UNSEEN_INLINE float least_of(const Floats& values) { return Vectors::least_of(values); }

    // A register of what the lanes have. (By way of an array, the processor would wait for its stores.)
    template <class Register, class Of>
    static UNSEEN_INLINE Register collect(Of of) {
        if constexpr (width == 4) return Register{of(0), of(1), of(2), of(3)};
        else return Register{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
    }

    static UNSEEN_INLINE Floats load(const float* from) {
        Floats v;
        std::memcpy(&v, from, sizeof v);
        return v;
    }
    static UNSEEN_INLINE void store(float* to, const Floats& v) { std::memcpy(to, &v, sizeof v); }
    static UNSEEN_INLINE Floats root_of(const Floats& square) { return Vectors::root_of(square); }

    // Abramowitz and Stegun 4.4.46; error below 2e-8 radians but for the cosine's own.
    static UNSEEN_INLINE Floats angle_of_cosine(const Floats& cosine) {
        const Floats x = min_of(abs_of(cosine), all(1));
        Floats series = all(-0.0012624911f);
        for (const float term : {0.0066700901f, -0.0170881256f, 0.0308918810f, -0.0501743046f, 0.0889789874f, -0.2145988016f, 1.5707963050f})
            series = series * x + term;
        const Floats angle = root_of(1 - x) * series;
        return cosine < 0 ? pi - angle : angle;
    }

    static UNSEEN_INLINE Ints load(const std::int32_t* from) {
        Ints v;
        std::memcpy(&v, from, sizeof v);
        return v;
    }

    static UNSEEN_INLINE Ints lane_bits() {
        Ints bits;
        std::int32_t values[width];
        for (std::size_t lane = 0; lane < width; ++lane) values[lane] = std::int32_t{1} << lane;
        std::memcpy(&bits, values, sizeof bits);
        return bits;
    }
    static UNSEEN_INLINE std::uint32_t bits_of(const Ints& mask) { return Vectors::bits_of(mask); }
    static UNSEEN_INLINE bool any(const Ints& mask) { return bits_of(mask) != 0; }
    static UNSEEN_INLINE Ints mask_of(std::uint32_t bits, std::size_t first) {
        return ((Ints{} + static_cast<std::int32_t>(bits >> first)) & lane_bits()) != 0;
    }

    // Of a table, at rows and bins. Lookups go lane by lane.
    static UNSEEN_INLINE Floats entries(const KernelView& view, const float* table, const Ints& rows, const Ints& bins) {
        const Ints at = view.bins == 1 ? rows : rows * view.bins + bins;
        return collect<Floats>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return table[static_cast<std::uint32_t>(at[lane])]; });
    }
    // The distances of rows at bins.
    static UNSEEN_INLINE Floats distances(const KernelView& view, const Ints& rows, const Ints& bins, const Floats& lengths) {
        // A length of 0 times infinity is no number.
        return max_of(lengths, all(least_length)) * view.inverse_threshold * entries(view, view.reach.data(), rows, bins);
    }

    // What a register's lanes are, and how they look.
    struct Nodes {
        Floats centre[3], radius, length, silhouette_length;
        Ints interior_row, silhouette_row;
    };
    struct Measures {
        Floats to_eye[3], distance, gap, eccentricity, interior, silhouette, height, uncovered;
        Ints bin, is_inside, is_near, is_asked;
    };
    // By how much nodes stand out from behind the occluder that hides most of them. A sphere around c is hidden by one of radius R around b
    // where, for some point q on the way from the eye to c, a share t of it, |q - b| + t r <= R: on the way to each of its points a point
    // as near to q lies in the occluder. The least excess over R, over all t, changes by no more than the eye's path, and
    // grows with spheres that nest.
    static UNSEEN_INLINE Floats uncovered(const KernelView& view, const Measures& m, const Floats& node_radius) {
        const Floats distance = max_of(m.distance, all(least_length)), inverse = 1 / distance;
        const Floats ray[3] = {-m.to_eye[0] * inverse, -m.to_eye[1] * inverse, -m.to_eye[2] * inverse};
        const Floats sine = occluded_radii * node_radius * inverse; // t r over the way to q
        const Floats slope = sine / root_of(max_of(1 - sine * sine, all(least_length)));
        Floats least = all(huge);
        for (const KernelView::Occluder& o : view.occluders) {
            const float(&b)[3] = o.towards;
            const Floats along = b[0] * ray[0] + b[1] * ray[1] + b[2] * ray[2];
            const Floats x = b[1] * ray[2] - b[2] * ray[1], y = b[2] * ray[0] - b[0] * ray[2], z = b[0] * ray[1] - b[1] * ray[0];
            const Floats beside_squared = x * x + y * y + z * z;
            const Floats way = min_of(max_of(along - root_of(beside_squared) * slope, all(0)), m.distance); // to the best q
            const Floats off = along - way;
            least = min_of(least, root_of(off * off + beside_squared) + way * sine - o.radius);
        }
        return least;
    }

    // Of a point, by its vector to the eye: over the lowest plane of the best frustum.
    static UNSEEN_INLINE Floats height(const KernelView& view, const Floats (&to_eye)[3]) {
        Floats best = all(view.planes.empty() ? huge : -huge);
        for (std::size_t f = 0; f + 1 < view.first_plane.size(); ++f) {
            Floats lowest = all(huge);
            for (std::size_t p = view.first_plane[f]; p < view.first_plane[f + 1]; ++p) {
                const KernelView::Plane& plane = view.planes[p];
                lowest = min_of(lowest, plane.offset - (to_eye[0] * plane.normal[0] + to_eye[1] * plane.normal[1] +
                                                        to_eye[2] * plane.normal[2]));
            }
            best = max_of(best, lowest);
        }
        return best;
    }

    static UNSEEN_INLINE Measures measure(const KernelView& view, const Nodes& of) {
        Measures m;
        Floats* const e = m.to_eye;
        for (int k = 0; k < 3; ++k) e[k] = (view.eye_high[k] - of.centre[k]) + view.eye_low[k];
        m.distance = root_of(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
        m.gap = m.distance - of.radius;
        m.bin = Ints{};
        m.eccentricity = all(0);
        if (view.has_gaze) {
            const Floats inverse = 1 / max_of(m.distance, all(least_length));
            const Floats towards = -(e[0] * view.gaze[0] + e[1] * view.gaze[1] + e[2] * view.gaze[2]) * inverse;
            const Floats half_angle = pi / 2 - angle_of_cosine(of.radius * inverse);
            const Floats eccentricity = max_of(angle_of_cosine(towards) - half_angle, all(0));
            m.eccentricity = m.distance > of.radius ? eccentricity : all(0);
            m.bin = __builtin_convertvector(min_of(m.eccentricity * view.bins_per_radian, all(static_cast<float>(view.bins - 1))), Ints);
        }
        m.interior = distances(view, of.interior_row, m.bin, of.length);
        m.silhouette = view.nobody ? m.interior : max_of(m.interior, distances(view, of.silhouette_row, m.bin, of.silhouette_length));

        m.height = height(view, m.to_eye) + of.radius;
        m.uncovered = all(huge);
        // Far nodes fold anyway.
        if (!view.occluders.empty() && (view.everybody || any(m.gap < m.silhouette)))
            m.uncovered = uncovered(view, m, of.radius);

        m.is_inside = (m.height >= 0) & (m.uncovered >= 0);
        m.is_near = m.gap < m.interior;
        m.is_asked = view.everybody ? m.is_inside : m.is_inside & (m.gap < m.silhouette);
        if (!view.near_ones_too && !view.everybody) m.is_asked &= ~m.is_near;
        if (view.nobody) m.is_asked = Ints{};
        return m;
    }

    static UNSEEN_INLINE void measure(const KernelView& view, FoldBatch& batch, std::size_t first) {
        const Nodes nodes = {{load(batch.centre[0] + first), load(batch.centre[1] + first), load(batch.centre[2] + first)},
                             load(batch.radius + first), load(batch.length + first), load(batch.silhouette_length + first),
                             load(batch.interior_row + first), load(batch.silhouette_row + first)};
        const Measures m = measure(view, nodes);
        for (int k = 0; k < 3; ++k) store(batch.to_eye[k] + first, m.to_eye[k]);
        store(batch.distance + first, m.distance);
        store(batch.gap + first, m.gap);
        store(batch.eccentricity + first, m.eccentricity);
        std::memcpy(batch.bin + first, &m.bin, sizeof m.bin);
        store(batch.interior + first, m.interior);
        store(batch.silhouette + first, m.silhouette);
        store(batch.height + first, m.height);
        store(batch.uncovered + first, m.uncovered);
        batch.is_inside |= bits_of(m.is_inside) << first;
        batch.is_near |= bits_of(m.is_near) << first;
        batch.is_asked |= bits_of(m.is_asked) << first;
    }
    static UNSEEN_INLINE void measure(const KernelView& view, FoldBatch& batch) {
        batch.is_inside = batch.is_near = batch.is_asked = 0;
        for (std::size_t first = 0; first < kernel_lanes; first += width) measure(view, batch, first);
    }

    // The farther the bins that are looked at, the more the gaze may turn, and the less path is left: the best of a few.
    //
    // While the clock advances by `path`, the gaze turns by path * turn_per_length, and a point at least `gap` away shifts by
    // asin(step / rest) for each step, the rest of the gap being what longest_path leaves: less than shift_per_gap * path / gap
    // in all.
    struct SlackQuery {
        Floats gap, inward, eccentricity, length, other_length;
        Ints row, other_row, bin;
    };
    static UNSEEN_INLINE Floats slack(const KernelView& view, const SlackQuery& of) {
        const Floats &gap = of.gap, &inward = of.inward, &eccentricity = of.eccentricity;
        const Ints& bin = of.bin;
        const auto within = [&](const Ints& at) UNSEEN_INLINE_LAMBDA {
            return max_of(distances(view, of.row, at, of.length), distances(view, of.other_row, at, of.other_length));
        };
        const Ints outward_bins = __builtin_convertvector(inward, Ints); // reaches shrink away from the gaze
        const Floats degrees = all(1 / view.bins_per_radian);
        const Floats turn_of_path = view.turn_per_length + shift_per_gap / max_of(gap, all(least_length));
        const Ints last = Ints{} + (view.bins - 1);
        Floats best = {};
        for (std::int32_t step = 0; step < view.bins; step = step == 0 ? 1 : 2 * step) {
            Ints reached = bin + outward_bins * step;
            reached = reached < 0 ? Ints{} : reached;
            reached = reached > last ? last : reached;
            const Floats there = (within(reached) - gap) * inward;
            // Up to the far edge of the bin that was looked at; none beyond the last.
            const Ints edge = reached + (inward > 0 ? Ints{} + 1 : Ints{});
            Floats turn = (__builtin_convertvector(edge, Floats) * degrees - eccentricity) * inward;
            turn = ((inward > 0) & (reached == last)) | ((inward < 0) & (reached == 0)) ? all(huge) : turn;
            const Floats path = min_of((turn - angle_rounding) / turn_of_path, longest_path * gap);
            best = max_of(best, min_of(there, path));
            if (!any(there > best)) break;
        }
        // From inside, or nearly, the eccentricity may be anything soon.
        const Floats anywhere = (within(last) - gap) * inward;
        return (gap > 0) | (inward < 0) ? best : max_of(anywhere, all(0));
    }
    static UNSEEN_INLINE void find_slacks(const KernelView& view, SlackBatch& batch) {
        for (std::size_t i = 0; i < kernel_lanes; i += width)
            store(batch.slack + i, slack(view, {load(batch.gap + i), load(batch.inward + i), load(batch.eccentricity + i), load(batch.length + i),
                                                load(batch.silhouette_length + i), load(batch.row + i), load(batch.silhouette_row + i),
                                                load(batch.bin + i)}));
    }

    // Brings the slacks to what they are in all. What is outside may be so by its height, or else by an occluder.
    struct Found {
        Floats position, facing, distance, radius, height, uncovered;
    };
    struct Slacks {
        Floats position, facing, planes;
    };
    struct Verdicts {
        Ints unfolded, outside, away;
    };
    static UNSEEN_INLINE Slacks finished(const Found& found, const Verdicts& verdicts) {
        const Floats inexact = (found.distance + found.radius) * position_rounding;
        const Floats position = verdicts.outside | verdicts.away ? all(huge) : max_of(found.position - inexact, all(0));
        Floats facing = found.facing - found.distance * facing_rounding;
        facing = verdicts.unfolded ? min_of(facing, found.uncovered - inexact) : facing;
        facing = verdicts.outside ? (found.height < 0 ? all(huge) : -found.uncovered - inexact) : facing;
        const Floats planes = verdicts.unfolded                       ? found.height - inexact
                              : verdicts.outside & (found.height < 0) ? -found.height - inexact
                                                                      : all(huge);
        return {position, max_of(facing, all(0)), max_of(planes, all(0))};
    }

    static UNSEEN_INLINE void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings, std::size_t first) {
        const Ints unfolded = mask_of(findings.unfolded, first), silhouettes = mask_of(findings.silhouettes, first);
        Floats position;
        if (view.has_gaze) {
            position = load(findings.position_slack + first);
        } else {
            const Floats gap = load(batch.gap + first), reach = silhouettes ? load(batch.silhouette + first) : load(batch.interior + first);
            position = unfolded ? reach - gap : gap - reach;
        }
        const Slacks slacks =
            finished({position, load(findings.facing_slack + first), load(batch.distance + first),
                      load(batch.radius + first), load(batch.height + first), load(batch.uncovered + first)},
                     {unfolded, ~mask_of(batch.is_inside, first), mask_of(findings.away, first)});
        store(findings.position_slack + first, slacks.position);
        store(findings.facing_slack + first, slacks.facing);
        store(findings.plane_slack + first, slacks.planes);
    }
    static UNSEEN_INLINE void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) {
        for (std::size_t first = 0; first < kernel_lanes; first += width) finish_slacks(view, batch, findings, first);
    }

    struct Interval {
        Floats lo, hi;
    };
    // Values of weight * slab.
    static UNSEEN_INLINE Interval scaled(const Interval& slab, const Floats& weight) {
        const Floats a = weight * slab.lo, b = weight * slab.hi;
        return {min_of(a, b), max_of(a, b)};
    }
    // Values of 1 or -1 times the slab.
    static UNSEEN_INLINE Interval turned(const Interval& slab, float sign) {
        return sign > 0 ? slab : Interval{-slab.hi, -slab.lo};
    }

    // The slabs of all lanes as floats.
    struct Slabs {
        static constexpr std::size_t count = NormalSlabs::axis_count * kernel_lanes;
        alignas(64) float lo[count];
        alignas(64) float hi[count];

        UNSEEN_INLINE explicit Slabs(const FacingBatch& batch) {
            // Sixteen rows of sixteen bytes, interleaved four times, are their columns.
            using Bytes = std::int8_t __attribute__((vector_size(16)));
            static_assert(kernel_lanes == 16);
            Bytes rows[16], mixed[16];
            std::memcpy(rows, batch.slabs, sizeof rows);
            for (int stage = 0; stage < 4; ++stage) {
                for (std::size_t i = 0; i < 8; ++i) {
                    mixed[2 * i] = __builtin_shufflevector(rows[i], rows[i + 8], 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
                    mixed[2 * i + 1] =
                        __builtin_shufflevector(rows[i], rows[i + 8], 8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
                }
                std::memcpy(rows, mixed, sizeof rows);
            }
            std::int8_t bytes[2 * count];
            std::memcpy(bytes, rows, sizeof bytes);
            for (std::size_t i = 0; i < count; ++i) lo[i] = bytes[i];
            for (std::size_t i = 0; i < count; ++i) hi[i] = bytes[count + i];
        }
        UNSEEN_INLINE Interval operator()(std::size_t axis, std::size_t first) const {
            return {load(lo + axis * kernel_lanes + first), load(hi + axis * kernel_lanes + first)};
        }
    };

    // Not more than 1 over the root of a squared reach of a parallelepiped, and falling with it: tangents, for the curve is convex.
    static UNSEEN_INLINE Floats inverse_reach(const Floats& squared) {
        const Floats near = max_of(near_tangent.at_0 - near_tangent.slope * squared,
                                   middle_tangent.at_0 - middle_tangent.slope * squared);
        return max_of(near, all(least_inverse_reach));
    }

    // Keeps the best of the parallelepipeds: the largest minimum, and the smallest maximum, each over the length that vectors may have there.
    struct Best {
        Floats least, largest;
        UNSEEN_INLINE void offer(const Floats& low, const Floats& high, const Floats& squared_reach) {
            const Floats shorter = inverse_reach(squared_reach);
            least = max_of(least, low * shorter);
            largest = min_of(largest, high * shorter);
        }
    };

    static UNSEEN_INLINE void run(const FacingBatch& batch, FacingGaps& gaps) {
        const Slabs slabs(batch);
        for (std::size_t first = 0; first < kernel_lanes; first += width) run(batch, slabs, gaps, first);
    }

    static UNSEEN_INLINE void run(const FacingBatch& batch, const Slabs& slabs, FacingGaps& gaps, std::size_t first) {
        const Floats e[3] = {load(batch.to_eye[0] + first), load(batch.to_eye[1] + first), load(batch.to_eye[2] + first)};
        const Gaps found = find_gaps<false>(e, load(batch.radius + first), Ints{}, [&](std::size_t axis) UNSEEN_INLINE_LAMBDA {
            return slabs(axis, first);
        });
        store(gaps.front + first, found.front);
        store(gaps.back + first, found.back);
    }

    struct Gaps {
        Floats front, back;
    };
    // With `signs_only` as soon as one of both is positive for all of the `asked` lanes; then only that counts.
    template <bool signs_only, class SlabOf>
    static UNSEEN_INLINE Gaps find_gaps(const Floats (&e)[3], const Floats& radius, const Ints& asked, SlabOf slab_of) {
        const Interval slab[3] = {slab_of(0), slab_of(1), slab_of(2)};
        const Floats distance = abs_of(e[0]) + abs_of(e[1]) + abs_of(e[2]); // an upper bound
        Floats squared[3];
        Interval along[3];
        for (int k = 0; k < 3; ++k) {
            const Floats reach = max_of(abs_of(slab[k].lo), abs_of(slab[k].hi));
            squared[k] = reach * reach;
            along[k] = scaled(slab[k], e[k]);
        }
        Best best{all(-1e30f), all(1e30f)};
        best.offer(along[0].lo + along[1].lo + along[2].lo, along[0].hi + along[1].hi + along[2].hi,
                   squared[0] + squared[1] + squared[2]);
        const Floats needed = radius + distance * rounding;
        constexpr float plenty = 0.125f; // of the distance
        const auto gaps = [&]() UNSEEN_INLINE_LAMBDA { return Gaps{best.least - needed, -best.largest - needed}; };
        const auto is_proved = [&](const Gaps& found) UNSEEN_INLINE_LAMBDA {
            return !any(asked & ~((found.front > 0) | (found.back > 0)));
        };
        if constexpr (signs_only) {
            const Gaps found = gaps();
            if (is_proved(found)) return found;
        } else {
            // Where the box alone proves everything, with much to spare, the rest would only add to that.
            const Floats spare = needed + distance * plenty;
            if (!any(~((best.least > spare) | (-best.largest > spare)))) return gaps();
        }
        constexpr float signs[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
#pragma GCC unroll 4
        for (std::size_t d = 0; d < 4; ++d) {
            const Interval diagonal = slab_of(3 + d);
#pragma GCC unroll 3
            for (int k = 0; k < 3; ++k) {
                // The diagonal in place of axis k: e = weight * diagonal + rest along i and j.
                const int i = (k + 1) % 3, j = (k + 2) % 3;
                const float sk = signs[d][k], si = signs[d][i], sj = signs[d][j];
                const Floats weight = e[k] * sk;
                const Interval a = scaled(diagonal, weight * sqrt3), b = scaled(slab[i], e[i] - weight * si),
                               c = scaled(slab[j], e[j] - weight * sj);
                // The replaced coordinate, sk * (sqrt3 * diagonal - si * x_i - sj * x_j), is in this interval.
                const Interval bi = turned(slab[i], si), bj = turned(slab[j], sj);
                const Floats high = diagonal.hi * sqrt3 - bi.lo - bj.lo, low = diagonal.lo * sqrt3 - bi.hi - bj.hi;
                const Floats reach = max_of(abs_of(low), abs_of(high));
                best.offer(a.lo + b.lo + c.lo, a.hi + b.hi + c.hi, reach * reach + squared[i] + squared[j]);
            }
            if constexpr (signs_only) {
                const Gaps found = gaps();
                if (is_proved(found)) return found;
            }
        }
        return gaps();
    }

    // ---- decisions without slacks

    // The bytes of the lanes' bounds after the sphere, four to an int: what find_gaps() and flags ask for.
    struct Words {
        Ints four[4];
        template <std::size_t at>
        UNSEEN_INLINE Ints byte() const { // as a signed number
            return (four[at / 4] << (24 - 8 * (at % 4))) >> 24;
        }
        UNSEEN_INLINE Interval slab(std::size_t axis) const {
            const auto byte_at = [&](std::size_t at) UNSEEN_INLINE_LAMBDA {
                return __builtin_convertvector((four[at / 4] << static_cast<int>(24 - 8 * (at % 4))) >> 24, Floats);
            };
            return {byte_at(axis), byte_at(NormalSlabs::axis_count + axis)};
        }
    };
    template <class Of>
    static UNSEEN_INLINE void load_sphere(Of sphere_of, Nodes& nodes) {
        static_assert(sizeof(Sphere) == sizeof(float) * 4);
        Floats columns[4];
        Vectors::load_columns(sphere_of, columns);
        for (int k = 0; k < 3; ++k) nodes.centre[k] = columns[k];
        nodes.radius = columns[3];
    }
    template <class At>
    static UNSEEN_INLINE Floats load_values(const float* from, At at) {
        return collect<Floats>([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return from[at(lane)]; });
    }

    // `at(lane)` is a lane's node.
    template <class At>
    static UNSEEN_INLINE Nodes load_nodes(const NodeArrays& arrays, At at) {
        Nodes nodes;
        if (arrays.support) load_sphere([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.support[at(lane)]; }, nodes);
        else load_sphere([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].ring; }, nodes);
        nodes.length = arrays.lengths ? load_values(arrays.lengths, at) : nodes.radius;
        nodes.silhouette_length = arrays.silhouette_lengths ? load_values(arrays.silhouette_lengths, at) : nodes.length;
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

    // ---- tests with slacks, from what a test reads of a node to its verdict

    struct Candidates {
        Nodes nodes;
        Floats ring[3], ring_radius;
        Words words;
    };
    template <class At>
    static UNSEEN_INLINE Candidates load_candidates(At at) {
        static_assert(offsetof(FoldCandidate, length) == 16 && offsetof(FoldCandidate, rows) == 24 && offsetof(FoldCandidate, ring) == 28 &&
                      offsetof(FoldCandidate, slabs) == 44 && offsetof(FoldCandidate, flags) == 58);
        static_assert(sizeof(FoldClass) == 4 && offsetof(FoldClass, interior) == 0 && std::endian::native == std::endian::little);
        Floats c[16];
        for (std::size_t quarter = 0; quarter < 4; ++quarter)
            Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return reinterpret_cast<const std::byte*>(at(lane)) + 16 * quarter; },
                                  c + 4 * quarter);
        const auto bits = [&](std::size_t column) UNSEEN_INLINE_LAMBDA { return reinterpret_cast<Ints>(c[column]); };
        const Ints interior_row = bits(6) & 0xffff, silhouette_row = (bits(6) >> 16) & 0xffff;
        return {{{c[0], c[1], c[2]}, c[3], c[4], c[5], interior_row, silhouette_row}, {c[7], c[8], c[9]}, c[10], {{bits(11), bits(12), bits(13), bits(14)}}};
    }

    template <class At>
    static UNSEEN_INLINE void test(const KernelView& view, At at, TestBatch& tested, std::size_t first) {
        const Candidates of = load_candidates(at);
        const Measures m = measure(view, of.nodes);
        Ints unfolded = m.is_inside & m.is_near, silhouettes = ~m.is_near, away = {};
        const Floats always = all(std::numeric_limits<float>::infinity());
        Floats facing = always;
        if (any(m.is_asked)) {
            Floats towards[3];
            for (int k = 0; k < 3; ++k) towards[k] = (view.eye_high[k] - of.ring[k]) + view.eye_low[k];
            const Gaps gaps = find_gaps<false>(towards, of.ring_radius, Ints{}, [&](std::size_t axis) UNSEEN_INLINE_LAMBDA { return of.words.slab(axis); });
            // An outline from everywhere; and what has no triangle with an area.
            const Ints irregular = (of.words.template byte<14>() & std::int32_t{irregular_ring}) != 0;
            const Ints empty = of.words.template byte<0>() > of.words.template byte<NormalSlabs::axis_count>();
            const Floats &shown = view.is_inside_out ? gaps.back : gaps.front, &hidden = view.is_inside_out ? gaps.front : gaps.back;
            const Floats front = irregular ? -always : empty ? always : shown, back = irregular | empty ? -always : hidden;
            const Ints is_silhouette = ~((front > 0) | (back > 0));
            away = view.near_ones_too ? m.is_asked & (back > 0) : Ints{};
            const Ints unfolds = m.is_near | (is_silhouette & (m.gap < m.silhouette));
            unfolded = m.is_asked ? unfolds & ~away : unfolded;
            silhouettes = m.is_asked ? is_silhouette & ~m.is_near : silhouettes;
            // Within the interior's distance nothing but facing away folds it.
            const Floats near = view.near_ones_too ? -back : always;
            const Floats far = is_silhouette ? min_of(-front, -back) : max_of(front, back);
            facing = m.is_asked ? (away ? back : m.is_near ? near : far) : facing;
        }
        Floats position;
        if (view.has_gaze) {
            position = slack(view, {m.gap, unfolded ? all(1) : all(-1), m.eccentricity, of.nodes.length,
                                    silhouettes ? of.nodes.silhouette_length : of.nodes.length, of.nodes.interior_row,
                                    silhouettes ? of.nodes.silhouette_row : of.nodes.interior_row, m.bin});
        } else {
            const Floats reach = silhouettes ? m.silhouette : m.interior;
            position = unfolded ? reach - m.gap : m.gap - reach;
        }
        const Slacks slacks = finished({position, facing, m.distance, of.nodes.radius, m.height, m.uncovered},
                                       {unfolded, ~m.is_inside, away});
        store(tested.position_slack + first, slacks.position);
        store(tested.facing_slack + first, slacks.facing);
        store(tested.plane_slack + first, slacks.planes);
        tested.unfolded |= bits_of(unfolded) << first;
    }
    static UNSEEN_INLINE void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) {
        tested.unfolded = 0;
        for (std::size_t first = 0; first < lanes.size(); first += width)
            test(view, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return lanes[std::min(first + lane, lanes.size() - 1)]; }, tested, first);
    }

    struct Facings {
        Ints silhouette, away;
    };
    template <class At>
    static UNSEEN_INLINE Facings find_facings(const KernelView& view, const NodeArrays& arrays, At at) {
        Nodes nodes;
        load_sphere([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].ring; }, nodes);
        Floats towards[3], columns[4];
        for (int k = 0; k < 3; ++k) towards[k] = (view.eye_high[k] - nodes.centre[k]) + view.eye_low[k];
        Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &arrays.bounds[at(lane)].slabs; }, columns);
        static_assert(offsetof(NodeBounds, slabs) == 16 && offsetof(NodeBounds, flags) == 30 && sizeof(NodeBounds) == 32);
        Words words;
        std::memcpy(words.four, columns, sizeof columns);
        const Ints irregular = (words.byte<14>() & std::int32_t{irregular_ring}) != 0;
        if (arrays.facing) {
            float slabs[width][4] = {}; // the last two bytes are of no slab
            for (std::size_t lane = 0; lane < width; ++lane) std::memcpy(slabs[lane], &arrays.facing[at(lane)], sizeof(NormalSlabs));
            Vectors::load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return slabs[lane]; }, columns);
            std::memcpy(words.four, columns, sizeof columns);
        }
        const Gaps gaps = find_gaps<true>(towards, nodes.radius, ~irregular,
                                          [&](std::size_t axis) UNSEEN_INLINE_LAMBDA { return words.slab(axis); });
        const Ints empty = words.byte<0>() > words.byte<NormalSlabs::axis_count>();
        const Floats &shown = view.is_inside_out ? gaps.back : gaps.front, &hidden = view.is_inside_out ? gaps.front : gaps.back;
        const Ints front = ~irregular & (empty | (shown > 0)), back = ~irregular & ~empty & (hidden > 0);
        return {~front & ~back, view.near_ones_too ? back : Ints{}};
    }

    // What nodes face that have to be asked, a register of them at a time: calls f(i, is_silhouette, is_away), the last two 0 or 1, for the `count`
    // places i in `asked`, which has room for a register more. Nodes by place: at(i).
    template <class At, class F>
    static UNSEEN_INLINE void for_each_asked(const KernelView& view, const NodeArrays& arrays, std::uint16_t* asked, std::size_t count, At at, F f) {
        std::fill_n(asked + count, width, count > 0 ? asked[0] : std::uint16_t{0});
        for (std::size_t first = 0; first < count; first += width) {
            const Facings facings = find_facings(view, arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return at(asked[first + lane]); });
            const std::uint32_t silhouettes = bits_of(facings.silhouette), away = bits_of(facings.away);
            for (std::size_t lane = 0; lane < std::min(width, count - first); ++lane)
                f(std::size_t{asked[first + lane]}, (silhouettes >> lane) & 1, (away >> lane) & 1);
        }
    }

    // Those of a piece of the nodes whose facing matters are looked at together, so that all lanes are of use.
    template <class NodeAt>
    static UNSEEN_INLINE void decide_all(const KernelView& view, const NodeArrays& arrays, std::size_t count, NodeAt node_at,
                                         std::uint64_t* unfolded) {
        constexpr std::size_t piece = 512, words = piece / 64;
        for (std::size_t start = 0; start < count; start += piece, unfolded += words) {
            const std::size_t size = std::min(piece, count - start);
            std::uint64_t near[words];
            std::uint16_t asked[piece + width];
            std::size_t asked_count = 0;
            for (std::size_t first = 0; first < size; first += 64) {
                const std::size_t end = std::min(first + 64, size);
                std::uint64_t seen_bits = 0, near_bits = 0, asked_bits = 0;
                for (std::size_t i = first; i < end; i += width) {
                    node_at.prefetch(start + i);
                    const auto at = [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return node_at(start + i + lane); };
                    const Measures m = measure(view, load_nodes(arrays, at));
                    near_bits |= std::uint64_t{bits_of(m.is_near)} << (i - first);
                    seen_bits |= std::uint64_t{bits_of(m.is_near & m.is_inside)} << (i - first);
                    if (any(m.is_asked)) asked_bits |= std::uint64_t{bits_of(m.is_asked)} << (i - first);
                }
                const std::uint64_t used = end - first < 64 ? (std::uint64_t{1} << (end - first)) - 1 : ~std::uint64_t{0};
                near[first / 64] = near_bits;
                unfolded[first / 64] = seen_bits & used;
                for (asked_bits &= used; asked_bits; asked_bits &= asked_bits - 1)
                    asked[asked_count++] = static_cast<std::uint16_t>(first + static_cast<std::size_t>(std::countr_zero(asked_bits)));
            }
            const auto at = [&](std::size_t i) UNSEEN_INLINE_LAMBDA { return node_at(start + i); };
            for_each_asked(view, arrays, asked, asked_count, at, [&](std::size_t i, std::uint32_t is_silhouette, std::uint32_t is_away) UNSEEN_INLINE_LAMBDA {
                const std::size_t word = i / 64, bit = i % 64;
                const std::uint64_t seen = ((near[word] >> bit) | is_silhouette) & ~std::uint64_t{is_away} & 1;
                unfolded[word] = (unfolded[word] & ~(std::uint64_t{1} << bit)) | (seen << bit);
            });
        }
    }

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
    static UNSEEN_INLINE void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes, std::uint64_t* unfolded) {
        decide_all(view, arrays, nodes.size(), Listed{arrays, nodes.data(), nodes.size() - 1}, unfolded);
    }
    static UNSEEN_INLINE void decide(const KernelView& view, const NodeArrays& arrays, NodeId start, std::size_t count, std::uint64_t* unfolded) {
        struct Range {
            std::size_t start;
            UNSEEN_INLINE std::size_t operator()(std::size_t i) const { return start + i; }
            UNSEEN_INLINE void prefetch(std::size_t) const {}
        };
        // Whole registers only; what is left goes node by node.
        const std::size_t whole = count / 64 * 64;
        decide_all(view, arrays, whole, Range{start}, unfolded);
        if (whole == count) return;
        NodeId rest[64];
        for (std::size_t i = 0; i < count - whole; ++i) rest[i] = static_cast<NodeId>(start + whole + i);
        decide(view, arrays, std::span(rest, count - whole), unfolded + whole / 64);
    }

    struct Costs {
        Floats cost, seen;
    };
    // By one row. See FoldTester::set_costs().
    static UNSEEN_INLINE Costs costs_of(const KernelView& view, const CostTables& tables, const Ints& row, const Measures& m, const Floats& unit) {
        const Floats reach = entries(view, tables.reach, row, m.bin), length = unit * reach;
        const Ints seldom = (reach < 0) | ((length <= 0) & (m.gap > 0)); // from nowhere, or from inside only
        const Ints always = (reach >= DistanceCriterion::always_visible) | (m.gap <= 0);
        const Floats cost = always ? all(std::numeric_limits<float>::infinity()) : length / m.gap;
        Costs costs{seldom ? all(0) : cost, {}};
        costs.seen = costs.cost;
        if (tables.least_cost) costs.seen = seldom ? all(0) : max_of(cost, entries(view, tables.least_cost, row, m.bin));
        return costs;
    }

    // As an outline's, which are the larger ones; of the interior where both are the same.
    static UNSEEN_INLINE Costs outline_costs(const KernelView& view, const CostTables& tables, const Nodes& of, const Measures& m, const Costs& inner) {
        const Costs outline = costs_of(view, tables, of.silhouette_row, m, of.silhouette_length);
        return {max_of(inner.cost, outline.cost), max_of(inner.seen, outline.seen)};
    }

    static UNSEEN_INLINE void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                                               std::span<const NodeId> nodes, float no_outline_over, float* cost, float* seen) {
        const Listed listed{arrays, nodes.data(), nodes.size() - 1};
        for (std::size_t i = 0; i < nodes.size(); i += width) {
            listed.prefetch(i);
            const Nodes of = load_nodes(arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return listed(i + lane); });
            const Measures m = measure(view, of);
            const Costs inner = costs_of(view, tables, of.interior_row, m, of.length), outline = outline_costs(view, tables, of, m, inner);
            const Ints is_none = outline.cost > no_outline_over;
            const Floats bound = m.is_inside ? (is_none ? inner.cost : outline.cost) : all(0);
            const Floats seen_bound = m.is_inside ? (is_none ? inner.seen : outline.seen) : all(0);
            if (i + width <= nodes.size()) {
                store(cost + i, bound);
                store(seen + i, seen_bound);
            } else {
                for (std::size_t lane = 0; i + lane < nodes.size(); ++lane) cost[i + lane] = bound[lane], seen[i + lane] = seen_bound[lane];
            }
        }
    }

    // Like decide_all().
    static UNSEEN_INLINE void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables,
                                         std::span<const NodeId> nodes, const NodeCosts& out) {
        constexpr std::size_t piece = 256;
        const Listed listed{arrays, nodes.data(), nodes.size() - 1};
        for (std::size_t start = 0; start < nodes.size(); start += piece) {
            const std::size_t size = std::min(piece, nodes.size() - start);
            // Of the interior; of the outline, where it is one; whether they unfold as the one and as the other.
            alignas(64) float cost[piece + width], seen[piece + width], outline_cost[piece + width], outline_seen[piece + width];
            std::uint8_t interior_unfolds[piece + width], outline_unfolds[piece + width];
            std::uint16_t asked[piece + width];
            std::size_t asked_count = 0;
            for (std::size_t i = 0; i < size; i += width) {
                listed.prefetch(start + i);
                const Nodes of = load_nodes(arrays, [&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return listed(start + i + lane); });
                const Measures m = measure(view, of);
                const Costs inner = costs_of(view, tables, of.interior_row, m, of.length);
                const Costs outline = outline_costs(view, tables, of, m, inner);
                store(cost + i, m.is_inside ? inner.cost : all(0));
                store(seen + i, m.is_inside ? inner.seen : all(0));
                store(outline_cost + i, outline.cost);
                store(outline_seen + i, outline.seen);
                const std::uint32_t near = bits_of(m.is_near & m.is_inside), within = bits_of(m.gap < m.silhouette);
                const std::uint32_t asked_bits = bits_of(m.is_asked);
                for (std::size_t lane = 0; lane < width; ++lane) {
                    interior_unfolds[i + lane] = (near >> lane) & 1;
                    outline_unfolds[i + lane] = ((near | within) >> lane) & 1;
                    asked[asked_count] = static_cast<std::uint16_t>(i + lane);
                    asked_count += (asked_bits >> lane) & 1 & (i + lane < size);
                }
            }
            const auto at = [&](std::size_t i) UNSEEN_INLINE_LAMBDA { return listed(start + i); };
            for_each_asked(view, arrays, asked, asked_count, at, [&](std::size_t i, std::uint32_t is_silhouette, std::uint32_t is_away) UNSEEN_INLINE_LAMBDA {
                if (is_away) {
                    cost[i] = seen[i] = 0;
                    interior_unfolds[i] = 0;
                } else if (is_silhouette) {
                    cost[i] = outline_cost[i], seen[i] = outline_seen[i];
                    interior_unfolds[i] = outline_unfolds[i];
                }
            });
            std::copy_n(cost, size, out.cost + start);
            std::copy_n(seen, size, out.seen_cost + start);
            for (std::size_t first = 0; first < size; first += 64) {
                std::uint64_t bits = 0;
                for (std::size_t i = first; i < std::min(first + 64, size); ++i) bits |= std::uint64_t{interior_unfolds[i]} << (i - first);
                out.unfolded[(start + first) / 64] = bits;
            }
        }
    }
};

// ---- blocks: a register at a time, then one by one

namespace blocks {

// The eye has moved by `path`. Seen from a point of the sphere, it has turned by that over the mean distance at most; the distances of
// the point and of the centre change alike but for that angle times the way between them.
UNSEEN_INLINE Vectors::Floats error_of(const Vectors::Floats& before, const Vectors::Floats& after, const Vectors::Floats& radius, float path) {
    using Floats = Vectors::Floats;
    const Floats between = before + after - 2 * radius, turned = 2 * path * radius / between;
    const Floats most = Floats{} + 2 * path;
    return (between > 0) & (turned < most) ? turned : most;
}

UNSEEN_INLINE void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) {
    using L = Lanes;
    using Floats = Vectors::Floats;
    const auto move = [&](const float* x, const float* y, const float* z, const float* r, float* distance, float* error) UNSEEN_INLINE_LAMBDA {
        const Floats ex = (eye_high[0] - L::load(x)) + eye_low[0], ey = (eye_high[1] - L::load(y)) + eye_low[1],
                     ez = (eye_high[2] - L::load(z)) + eye_low[2];
        const Floats after = L::root_of(ex * ex + ey * ey + ez * ez);
        const Floats more = error_of(L::load(distance), after, L::load(r), path);
        constexpr float up = 1 + 5e-7f; // small steps must not be lost in the sum's rounding
        L::store(error, (L::load(error) + more) * up);
        L::store(distance, after);
    };
    const std::size_t count = spheres.x.size();
    std::size_t i = 0;
    for (; i + L::width <= count; i += L::width)
        move(&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], &spheres.distance[i], &spheres.error[i]);
    if (i == count) return;
    float rest[6][L::width] = {};
    std::vector<float>* const values[6] = {&spheres.x, &spheres.y, &spheres.z, &spheres.radius, &spheres.distance, &spheres.error};
    for (std::size_t v = 0; v < 6; ++v) std::copy(values[v]->begin() + static_cast<std::ptrdiff_t>(i), values[v]->end(), rest[v]);
    move(rest[0], rest[1], rest[2], rest[3], rest[4], rest[5]);
    for (std::size_t v = 4; v < 6; ++v) std::copy_n(rest[v], count - i, values[v]->begin() + static_cast<std::ptrdiff_t>(i));
}

UNSEEN_INLINE void keep_inside(const KernelView& view, float hair, const KernelClock& clock,
                               const BlockSpheres& spheres, float* deadlines) {
    using L = Lanes;
    using Floats = Vectors::Floats;
    const auto keep = [&](const float* x, const float* y, const float* z, const float* radius,
                          float* deadline) UNSEEN_INLINE_LAMBDA {
        const Floats before = L::load(deadline);
        if (!L::any(before <= clock.late)) return;
        const Floats to_eye[3] = {(view.eye_high[0] - L::load(x)) + view.eye_low[0],
                                  (view.eye_high[1] - L::load(y)) + view.eye_low[1],
                                  (view.eye_high[2] - L::load(z)) + view.eye_low[2]};
        const Floats slack = L::height(view, to_eye) - L::load(radius) - hair;
        L::store(deadline, (before <= clock.late) & (slack > 0) ? (clock.early + slack) * just_less : before);
    };
    const std::size_t count = spheres.x.size();
    std::size_t i = 0;
    for (; i + L::width <= count; i += L::width)
        keep(&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], deadlines + i);
    if (i == count) return;
    float rest[5][L::width] = {};
    const float* const values[5] = {&spheres.x[i], &spheres.y[i], &spheres.z[i], &spheres.radius[i], deadlines + i};
    for (std::size_t v = 0; v < 5; ++v) std::copy_n(values[v], count - i, rest[v]);
    keep(rest[0], rest[1], rest[2], rest[3], rest[4]);
    std::copy_n(rest[4], count - i, deadlines + i);
}

UNSEEN_INLINE std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock, const BlockDues* dues,
                                         const std::uint16_t* unfolded, const BlockSpheres& spheres, BlockDeadlines& deadlines, std::uint32_t* due) {
    using L = Lanes;
    using Floats = Vectors::Floats;
    using Ints = Vectors::Ints;
    const Floats never = L::all(std::numeric_limits<float>::infinity());
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
        const Floats recede = L::all(passed + spheres.distance[block]), approach = L::all(passed - spheres.distance[block]);
        Floats next_recede = never, next_approach = never, next_facing = never;
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < block_slots; i += L::width) {
            const Floats position = L::load(dues[block].position + i), facing = L::load(dues[block].facing + i);
            const Ints recedes = L::mask_of(unfolded[block], i);
            const Ints is_due = (position <= (recedes ? recede : approach)) | (facing <= facing_clock);
            bits |= L::bits_of(is_due) << i;
            next_recede = L::min_of(next_recede, ~is_due & recedes ? position : never);
            next_approach = L::min_of(next_approach, is_due | recedes ? never : position);
            next_facing = L::min_of(next_facing, is_due ? never : facing);
        }
        deadlines.set(block, L::least_of(next_recede), L::least_of(next_approach), L::least_of(next_facing));
        // How many slots are due, nobody could foretell: a few places are written in any case, those too many by the next block again.
        const std::uint32_t first = block * static_cast<std::uint32_t>(block_slots);
        std::uint32_t* const next = due + count;
        count += static_cast<std::size_t>(std::popcount(bits));
        constexpr std::size_t mostly = 4;
        for (std::size_t i = 0; i < mostly; ++i, bits &= bits - 1) next[i] = first + static_cast<std::uint32_t>(std::countr_zero(bits | none_due));
        for (std::size_t i = mostly; bits; ++i, bits &= bits - 1) next[i] = first + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
    return count;
}

UNSEEN_INLINE void find_dues(const TestBatch& tested, DueBatch& dues) {
    using L = Lanes;
    using Floats = Vectors::Floats;
    const Floats none = L::all(0);
    for (std::size_t i = 0; i < kernel_lanes; i += L::width) {
        const auto unfolded = L::mask_of(tested.unfolded, i);
        const Floats passed = L::load(dues.passed + i), distance = L::load(dues.distance + i);
        const Floats hair = unfolded ? L::all(dues.hair) : none;
        const Floats left = L::max_of(L::min_of(L::all(dues.longest), L::load(tested.position_slack + i)) - hair, none);
        const Floats slack = left - sum_rounding * (passed + distance + L::min_of(left, distance));
        L::store(dues.position + i, passed + slack + (unfolded ? distance : -distance));
        L::store(dues.facing + i, (dues.facing_clock + L::max_of(L::load(tested.facing_slack + i) - hair, none)) * just_less);
    }
}

UNSEEN_INLINE void find_due(float position, float facing, const BlockSpheres& spheres, const BlockDeadlines& deadlines, std::uint64_t* due) {
    using L = Lanes;
    const std::size_t count = spheres.x.size();
    for (std::size_t first = 0; first < count; first += 64) {
        std::uint64_t bits = 0;
        const std::size_t end = std::min(first + 64, count);
        std::size_t i = first;
        for (; i + L::width <= end; i += L::width) {
            const auto distance = L::load(&spheres.distance[i]), passed = L::load(&spheres.error[i]) + position;
            const auto is_due = (L::load(&deadlines.recede[i]) <= passed + distance) | (L::load(&deadlines.approach[i]) <= passed - distance) |
                                (L::load(&deadlines.facing[i]) <= facing);
            bits |= std::uint64_t{L::bits_of(is_due)} << (i - first);
        }
        for (; i < end; ++i) {
            const float distance = spheres.distance[i], passed = spheres.error[i] + position;
            const bool is_due = deadlines.recede[i] <= passed + distance || deadlines.approach[i] <= passed - distance ||
                                deadlines.facing[i] <= facing;
            bits |= std::uint64_t{is_due} << (i - first);
        }
        due[first / 64] = bits;
    }
}

} // namespace blocks

struct Kernels {
    static void measure(const KernelView& view, FoldBatch& batch) noexcept { Lanes::measure(view, batch); }
    static void find_slacks(const KernelView& view, SlackBatch& batch) noexcept { Lanes::find_slacks(view, batch); }
    static void finish_slacks(const KernelView& view, const FoldBatch& batch, Findings& findings) noexcept {
        Lanes::finish_slacks(view, batch, findings);
    }
    static void facing_gaps(const FacingBatch& batch, FacingGaps& gaps) noexcept { Lanes::run(batch, gaps); }
    static void test(const KernelView& view, std::span<const FoldCandidate* const> lanes, TestBatch& tested) noexcept { Lanes::test(view, lanes, tested); }
    static void decide(const KernelView& view, const NodeArrays& arrays, std::span<const NodeId> nodes, std::uint64_t* unfolded) noexcept {
        Lanes::decide(view, arrays, nodes, unfolded);
    }
    static void decide_range(const KernelView& view, const NodeArrays& arrays, NodeId first, std::size_t count, std::uint64_t* unfolded) noexcept {
        Lanes::decide(view, arrays, first, count, unfolded);
    }
    static void find_costs(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                           const NodeCosts& costs) noexcept {
        Lanes::find_costs(view, arrays, tables, nodes, costs);
    }
    static void find_cost_bounds(const KernelView& view, const NodeArrays& arrays, const CostTables& tables, std::span<const NodeId> nodes,
                                 float no_outline_over, float* cost, float* seen_cost) noexcept {
        Lanes::find_cost_bounds(view, arrays, tables, nodes, no_outline_over, cost, seen_cost);
    }
    static void move_blocks(const float (&eye_high)[3], const float (&eye_low)[3], float path, BlockSpheres& spheres) noexcept {
        blocks::move_blocks(eye_high, eye_low, path, spheres);
    }
    static void keep_inside(const KernelView& view, float hair, const KernelClock& clock, const BlockSpheres& spheres,
                            float* deadlines) noexcept {
        blocks::keep_inside(view, hair, clock, spheres, deadlines);
    }
    static std::size_t look_at_blocks(std::span<const std::uint32_t> which, float position_clock, float facing_clock, const BlockDues* dues,
                                      const std::uint16_t* unfolded, const BlockSpheres& spheres, BlockDeadlines& deadlines,
                                      std::uint32_t* due) noexcept {
        return blocks::look_at_blocks(which, position_clock, facing_clock, dues, unfolded, spheres, deadlines, due);
    }
    static void find_dues(const TestBatch& tested, DueBatch& dues) noexcept { blocks::find_dues(tested, dues); }
    static void find_due(float position_clock, float facing_clock, const BlockSpheres& spheres, const BlockDeadlines& deadlines,
                         std::uint64_t* due) noexcept {
        blocks::find_due(position_clock, facing_clock, spheres, deadlines, due);
    }
};
