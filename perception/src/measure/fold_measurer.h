// Compares every fold with the surface before it, by points and by small pictures, from the leaves up.
#pragma once

#include <unseen/vdtree/internal/parallel.h>

#include "fold/fold_factors.h"
#include "measure/measure_folds.h"
#include "measure/open_border.h"
#include "measure/texture_change.h"

namespace unseen::perception {

using namespace vdtree;
using namespace measurement;

constexpr Index none = 0xffffffffu;
constexpr float least_beside = 1e-4f;  // share of the width: a hundred times the rounding of distances
constexpr Index leaves_of_part = 4096; // of a subtree that one task measures

// Measures every fold of trees that are the same except for their luminances. These decide which neighbours are folded
// with a node: what a light makes of several luminances may let as many fold as any of them does, or as few as all do.
// If the two differ, both are measured, each with all luminances.
//
// Points of textured trees also have texture coordinates. What is compared is the texture's luminance there, times
// theirs.
//
// Colours are three luminances of one tree (as_luminances()), which has its own decide: `deciding` is 1 then.
template <std::size_t luminances, bool is_textured, std::size_t deciding = luminances>
class Measurer {
    static constexpr std::size_t channels = luminances + (is_textured ? 2 : 0);
    using Point = LitPointOf<channels>;
    using Difference = FoldDifference<luminances>;
    using RingTriangle = perception::RingTriangle<channels>;
    using Points = ComparedPoints<channels>;
    using Surface = perception::Surface<channels>;
    using FoldPicture = FoldPictureOf<channels>;
    using Texture = TextureChange<luminances>;

public:
    // `trees`: as many as decide, the same except for their luminances. `luminance`: of a wedge, the i-th; with colours
    // and a texture the primaries. `contacts`: of the trees.
    Measurer(std::span<const SoundTree> trees, const FunctionRef<float(std::size_t, WedgeId)>& luminance,
             std::span<const TexturedLight> lights, const TextureDetail* texture, std::span<MeasuredFolds> found,
             std::vector<Contact> contacts)
        : tree_(trees.front()), lights_(lights), found_(found), first_leaf_(tree_.first_leaf()),
          leaf_end_(tree_.leaf_end()), first_triangle_(tree_.first_triangle()), triangles_(tree_.triangles()),
          support_(tree_.support_spheres()), interior_(tree_.interior_count()), mesh_(tree_), border_(tree_, mesh_),
          neighbours_(trees), crossing_(interior_), contacts_(std::move(contacts)), witnesses_(interior_),
          points_(tree_.wedge_count()) {
        for (WedgeId wedge = 0; wedge < tree_.wedge_count(); ++wedge) {
            Point& to = points_[wedge];
            to.position = tree_.positions()[wedge];
            for (std::size_t i = 0; i < luminances; ++i) to.luminance[i] = luminance(i, wedge);
            if constexpr (is_textured) {
                const glm::vec2 uv = tree_.uvs()[wedge];
                to.luminance[Texture::u_channel] = uv.x, to.luminance[Texture::v_channel] = uv.y;
            }
        }
        if constexpr (is_textured) texture_.emplace(tree_, lights_, *texture, deciding < luminances);
    }

    // False where it was cancelled.
    bool run(MeasuringProgress& progress) {
        std::vector<NodeId> parts, above;
        for (NodeId node = 0; node < interior_;) {
            const bool is_part = leaf_end_[node] - first_leaf_[node] <= leaves_of_part;
            (is_part ? parts : above).push_back(node);
            node = is_part ? tree_.subtree_end()[node] : node + 1;
        }
        constexpr NodeId at_once = 64; // nodes between looks at the clock
        parallel_loop(std::size_t{0}, parts.size(), [&](std::size_t i) {
            const NodeId begin = parts[i], end = tree_.subtree_end()[begin];
            Scratch scratch;
            for (NodeId last = end; last > begin && !progress.is_cancelled();) {
                const NodeId first = last - std::min(last - begin, at_once);
                for (NodeId node = last; node-- > first;) measure(node, scratch);
                progress.add(last - first);
                last = first;
            }
        });
        Scratch scratch;
        for (std::size_t i = above.size(); i-- > 0 && progress.add(1);) measure(above[i], scratch);
        return !progress.is_cancelled();
    }

private:
    struct Mean {
        Difference sum;
        int count = 0;
        void include(const Difference& other) {
            sum.distance += other.distance, sum.slide += other.slide;
            for (std::size_t i = 0; i < luminances; ++i) sum.luminance[i] += other.luminance[i];
            ++count;
        }
        Difference value() const {
            const float share = 1 / static_cast<float>(std::max(count, 1));
            Difference mean{sum.distance * share, sum.slide * share, sum.luminance};
            for (float& luminance : mean.luminance) luminance *= share;
            return mean;
        }
    };
    struct Sample {
        Point point;
        unsigned sheet;  // of RingTriangle
        Index leaf;      // none for points that are no leaves
        bool is_typical; // not chosen for its error
        Difference error;
    };
    // What the steps for one node leave for the next ones: add_samples() the samples, lay_out() the ring,
    // compare_surfaces() the samples' errors and whether the fine surfaces count, draw() the pictures.
    struct Scratch {
        std::vector<Sample> samples;
        Ring<channels> ring;
        std::vector<NodeId> shown_before; // Ring::shown as it was measured before
        Surface before_surface, after_surface;
        float aside = 0; // of Surface::compare()
        Points points;
        bool compares_fine = false; // the fine surfaces are others than the coarse ones, and small enough
        std::array<FoldPicture, picture_sizes.size()> pictures;
        typename Texture::Here texture; // with a texture
    };
    using Witnesses = std::array<Index, witness_count>;

    const Point& leaf_point(Index leaf) const { return points_[tree_.wedge_of_leaf(leaf)]; }

    // Triangles with a corner in the support that the children, folded, leave. Those that vanish below them come from where
    // their third corner is, too, as points at the proxy: parts of few leaves keep these, for the model was fitted so. In
    // large ones they would be all of the mesh.
    std::vector<Index> crossing(NodeId node) {
        std::vector<Index> all;
        tree_.for_each_child(node, [&](NodeId child) {
            if (tree_.is_place(child)) {
                const std::span<const Index> around = mesh_.around(child - interior_);
                all.insert(all.end(), around.begin(), around.end());
                return;
            }
            const bool is_large = leaf_end_[node] - first_leaf_[node] > leaves_of_part;
            const Index vanished = first_triangle_[is_large ? node + 1 : child],
                        end = first_triangle_[is_large ? tree_.subtree_end()[node] : child + 1];
            for (const Index t : crossing_[child])
                if (t < vanished || t >= end) all.push_back(t);
            std::vector<Index>().swap(crossing_[child]);
        });
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

    void measure(NodeId node, Scratch& scratch) {
        crossing_[node] = crossing(node);
        scratch.samples.clear();
        add_samples(node, scratch);
        FoldFacing facing;
        facing.is_height_field = 1;
        FoldRecord record;
        std::array<FoldRecord, luminances> records; // of the luminances alone
        if constexpr (is_textured) found_[0].textures[node] = {};
        measure(node, Says::any, scratch, record, records, facing);
        if constexpr (deciding > 1) {
            scratch.shown_before.swap(scratch.ring.shown);
            measure(node, Says::all, scratch, record, records, facing);
        }
        choose_witnesses(node, scratch.samples);
        record.gap = contacts_[node].gap, record.sine = contacts_[node].sine;
        for (std::size_t i = 0; i < luminances; ++i) {
            FoldRecord& own = found_[i].folds[node];
            own = record;
            own.largest_luminance = records[i].largest_luminance, own.mean_luminance = records[i].mean_luminance;
            std::memcpy(own.amplitudes, records[i].amplitudes, sizeof own.amplitudes);
            found_[i].facing[node] = facing;
            if constexpr (is_textured) found_[i].textures[node] = found_[0].textures[node];
        }
    }

    // Raises what was found before. Does nothing where all neighbours are as they were then.
    void measure(NodeId node, Says says, Scratch& scratch, FoldRecord& record,
                 std::span<FoldRecord, luminances> records, FoldFacing& facing) {
        Ring<channels>& ring = scratch.ring;
        const auto stand_in = [&](Index leaf) { return neighbours_.stand_in(leaf, node, says); };
        const NormalSlabs turned =
            lay_out(tree_, std::span<const Point>(points_), node, crossing_[node], stand_in, ring).slabs();
        if (says == Says::all && ring.shown == scratch.shown_before) return;
        facing.facing |= turned;
        const Point proxy = points_[tree_.first_wedge(node)];
        if (ring.after.empty()) ring.after.push_back({{proxy, proxy, proxy}, 7}); // all of it vanishes
        const auto raise = [](float& to, float value) { to = std::max(to, value); };
        const float extent = mean_reach(std::span<const RingTriangle>(ring.after), proxy) / 2,
                    width = std::max(support_[node].radius, extent);
        scratch.aside = tree_.has_seams() ? seam_width * width : 0.0f;
        if constexpr (is_textured) texture_->look_at(node, crossing_[node], width, scratch.texture);
        Difference worst;
        Difference mean = compare_surfaces(scratch, worst);
        FoldRecord drawn;
        const bool is_shown = draw(node, scratch, width, drawn, records);
        raise(record.shift, drawn.shift);
        if (worst.distance > least_beside * width && worst.distance > beside_the_ring * drawn.shift) {
            add_surroundings(
                tree_, std::span<const Point>(points_), node, crossing_[node], stand_in,
                [&](NodeId place) { return mesh_.around(place - interior_); }, ring);
            worst = {};
            mean = compare_surfaces(scratch, worst);
        }
        raise(record.farthest, worst.distance), raise(record.mean_distance, mean.distance);
        raise(record.extent, extent);
        raise(record.border, border_.shift(node, crossing_[node], stand_in));
        for (std::size_t i = 0; i < luminances; ++i)
            raise(records[i].largest_luminance, worst.luminance[i]),
                raise(records[i].mean_luminance, mean.luminance[i]);
        raise(record.thickness, add_slivers(scratch, width, mean, records));
        facing.is_height_field &= is_shown;
        if constexpr (is_textured) {
            if (!is_shown || tree_.bounds()[node].ring.radius > factors::longest_ring * width)
                raise(scratch.texture.slide, worst.slide);
            texture_->find_detail(node, width, scratch.texture, ring, record, found_[0].textures[node]);
        }
    }

    Difference difference(const Points& points, std::size_t i, const Scratch& scratch) const {
        Difference found{points.distance(i), 0, {}};
        const auto here = points.here(i), there = points.there(i);
        if constexpr (is_textured) {
            texture_->compare(here, there, scratch.texture, found);
        } else {
            for (std::size_t k = 0; k < luminances; ++k) found.luminance[k] = std::abs(here[k] - there[k]);
        }
        return found;
    }

    // Raises the worst errors to those between the surfaces; returns the mean ones.
    Difference compare_surfaces(Scratch& scratch, Difference& worst) {
        scratch.before_surface.assign(scratch.ring.before, scratch.ring.around);
        scratch.after_surface.assign(scratch.ring.after, scratch.ring.around);
        Mean over_leaves, over_before, over_after;
        scratch.points.clear();
        for (const Sample& sample : scratch.samples) scratch.points.add(sample.point, sample.sheet);
        scratch.after_surface.compare(scratch.points, scratch.aside);
        for (std::size_t i = 0; i < scratch.samples.size(); ++i) {
            Sample& sample = scratch.samples[i];
            const Difference error = difference(scratch.points, i, scratch);
            sample.error.include(error);
            worst.include(error);
            if (sample.is_typical) over_leaves.include(error);
        }
        compare(scratch.ring.before, scratch.after_surface, scratch, worst, over_before);
        compare(scratch.ring.after, scratch.before_surface, scratch, worst, over_after);
        Difference mean = over_leaves.value();
        mean.include(over_before.value());
        mean.include(over_after.value());
        scratch.compares_fine = scratch.ring.fine_before.size() <= most_fine_triangles &&
                                !(are_equal(scratch.ring.before, scratch.ring.fine_before) &&
                                  are_equal(scratch.ring.after, scratch.ring.fine_after));
        if (scratch.compares_fine) {
            Mean over_fine_before, over_fine_after;
            scratch.before_surface.assign(scratch.ring.fine_before, scratch.ring.fine_around);
            scratch.after_surface.assign(scratch.ring.fine_after, scratch.ring.fine_around);
            compare(scratch.ring.fine_before, scratch.after_surface, scratch, worst, over_fine_before);
            compare(scratch.ring.fine_after, scratch.before_surface, scratch, worst, over_fine_after);
            mean.include(over_fine_before.value());
            mean.include(over_fine_after.value());
        }
        return mean;
    }

    // A ring narrower than a picture's cells falls between their middles: the light that it adds somewhere along it, in the
    // mean, counts by its share of the cells, and of those of wider bands. Returns the ring's mean width; 0 where no picture's
    // cells are wider.
    float add_slivers(Scratch& scratch, float width, const Difference& mean,
                      std::span<FoldRecord, luminances> records) {
        float area = 0;
        for (const RingTriangle& t : scratch.ring.after) area += area_of(t);
        const auto cells_of = [&](std::size_t size) {
            return area / (2 * width) / (2 * picture_sizes[size] * width / picture_side);
        };
        if (!(cells_of(picture_sizes.size() - 1) < 1)) return 0;
        std::array<float, luminances> added = mean.luminance;
        if constexpr (!is_textured)
            if (scratch.ring.after.size() <= most_fine_triangles) added = added_along(scratch);
        for (std::size_t size = 0; size < picture_sizes.size(); ++size) {
            const float cells = cells_of(size);
            for (std::size_t band = 0; band < picture_bands && cells < 1; ++band)
                for (std::size_t i = 0; i < luminances; ++i) {
                    float& amplitude = records[i].amplitudes[size][band];
                    amplitude = std::max(amplitude, std::min(added[i], mean.luminance[i]) * cells *
                                                        std::exp2(-static_cast<float>(band)));
                }
        }
        return area / (2 * width);
    }
    static float area_of(const RingTriangle& t) {
        const glm::vec3 a = t.corner[0].position;
        return glm::length(glm::cross(t.corner[1].position - a, t.corner[2].position - a)) / 2;
    }

    // By how much a narrow ring, folded, is brighter or darker than before across all of it: the most in any part of its
    // length, over the ring's mean width.
    std::array<float, luminances> added_along(Scratch& scratch) {
        std::array<float, luminances> most{};
        for (const auto& [before, around, after] :
             {std::tuple(&scratch.ring.before, &scratch.ring.around, &scratch.ring.after),
              std::tuple(&scratch.ring.fine_before, &scratch.ring.fine_around, &scratch.ring.fine_after)}) {
            if (before == &scratch.ring.fine_before && !scratch.compares_fine) break;
            scratch.before_surface.assign(*before, *around);
            include_added(std::span<const RingTriangle>(*after), scratch, most);
        }
        return most;
    }
    void include_added(std::span<const RingTriangle> after, Scratch& scratch, std::array<float, luminances>& most) {
        glm::vec3 axis(0); // the longest edge
        float area = 0;
        for (const RingTriangle& t : after) {
            area += area_of(t);
            for (std::size_t k = 0; k < 3; ++k) {
                const glm::vec3 edge = t.corner[(k + 1) % 3].position - t.corner[k].position;
                if (glm::dot(edge, edge) > glm::dot(axis, axis)) axis = edge;
            }
        }
        if (!(area > 0) || scratch.before_surface.empty()) return;
        Points& points = scratch.points;
        points.clear();
        const auto between = [](const Point& a, const Point& b, float share) {
            Point to = a;
            to.position += share * (b.position - a.position);
            for (std::size_t i = 0; i < luminances; ++i) to.luminance[i] += share * (b.luminance[i] - a.luminance[i]);
            return to;
        };
        std::vector<std::pair<float, float>> places; // along the axis, and the area that a point stands for
        float low = std::numeric_limits<float>::infinity(), high = -low;
        for (const RingTriangle& t : after) {
            std::array<float, 3> along;
            for (std::size_t k = 0; k < 3; ++k) along[k] = glm::dot(t.corner[k].position, axis);
            const auto [first, last] = std::minmax({along[0], along[1], along[2]});
            low = std::min(low, first), high = std::max(high, last);
            // In slices across, which are as wide as they are far from the longest edge's ends.
            std::size_t a = 0, c = 0;
            for (std::size_t k = 0; k < 3; ++k) {
                if (along[k] == first) a = k;
                if (along[k] == last) c = k;
            }
            if (a == c) continue; // across, or a point
            const Point &from = t.corner[a], &to = t.corner[c], &aside = t.corner[3 - a - c];
            const float bend = (along[3 - a - c] - first) / (last - first);
            for (std::size_t slice = 0; slice < sliver_slices; ++slice) {
                const float at = (static_cast<float>(slice) + 0.5f) / sliver_slices;
                const Point on_edge = between(from, to, at),
                            across = at < bend ? between(from, aside, at / bend)
                                               : between(aside, to, (at - bend) / (1 - bend));
                const float share = at < bend ? at / bend : (1 - at) / (1 - bend); // of the largest width
                for (const float side : {1.0f / 6, 0.5f, 5.0f / 6}) {
                    points.add(between(on_edge, across, side), t.sheet);
                    places.emplace_back(first + at * (last - first), 2 * share * area_of(t) / (3 * sliver_slices));
                }
            }
        }
        if (points.size() == 0 || !(high > low)) return;
        scratch.before_surface.compare(points, scratch.aside);
        std::array<std::array<float, luminances>, sliver_slices> added{};
        for (std::size_t i = 0; i < points.size(); ++i) {
            const float part = (places[i].first - low) / (high - low) * sliver_slices;
            auto& to = added[std::min(static_cast<std::size_t>(std::max(part, 0.0f)), sliver_slices - 1)];
            const auto here = points.here(i), there = points.there(i);
            for (std::size_t k = 0; k < luminances; ++k) to[k] += (here[k] - there[k]) * places[i].second;
        }
        for (const auto& part : added)
            for (std::size_t k = 0; k < luminances; ++k)
                most[k] = std::max(most[k], std::abs(part[k]) * sliver_slices / area);
    }

    // Compares pictures of the mesh with those of the folded surface: with folded neighbours, and with none folded.
    // Returns whether nothing is hidden under something else.
    bool draw(NodeId node, Scratch& scratch, float width, FoldRecord& record,
              std::span<FoldRecord, luminances> records) const {
        glm::vec3 normal(0);
        for (const RingTriangle& t : scratch.ring.after) {
            const glm::vec3 a = t.corner[0].position;
            normal += glm::cross(t.corner[1].position - a, t.corner[2].position - a);
        }
        const float length = glm::length(normal);
        if (!(length > 0) || !(width > 0)) return false;
        std::array<FoldPicture, picture_sizes.size()>& pictures = scratch.pictures;
        for (std::size_t size = 0; size < pictures.size(); ++size)
            pictures[size].look(tree_.position(node), normal / length, picture_sizes[size] * width);
        draw_mesh(node, scratch);
        if constexpr (is_textured) texture_->begin_pictures(pictures, scratch.texture);
        const auto weights = [&](std::size_t size) -> const typename FoldPicture::BandCells* {
            if constexpr (is_textured) return &scratch.texture.weights[size];
            else return nullptr;
        };
        const auto compare = [&](std::span<const RingTriangle> folded) {
            for (FoldPicture& picture : pictures) picture.clear(FoldPicture::Layer::folded);
            for (const RingTriangle& t : folded) draw(FoldPicture::Layer::folded, t.corner, pictures);
            for (std::size_t size = 0; size < pictures.size(); ++size) {
                if constexpr (is_textured) texture_->finish_picture(pictures[size], size, scratch.texture);
                const typename FoldPicture::Difference difference =
                    pictures[size].difference(luminances, weights(size));
                record.shift = std::max(record.shift, difference.shift);
                for (std::size_t i = 0; i < luminances; ++i)
                    for (std::size_t band = 0; band < picture_bands; ++band) {
                        float& amplitude = records[i].amplitudes[size][band];
                        amplitude = std::max(amplitude, difference.amplitudes[i][band]);
                    }
            }
        };
        compare(scratch.ring.after);
        if (scratch.compares_fine) compare(scratch.ring.fine_after);
        return std::all_of(pictures.begin(), pictures.end(),
                           [](const FoldPicture& picture) { return picture.is_height_field(); });
    }

    static void draw(typename FoldPicture::Layer layer, const Point (&corner)[3], std::span<FoldPicture> pictures) {
        const auto a = pictures[0].place(corner[0]), b = pictures[0].place(corner[1]), c = pictures[0].place(corner[2]);
        for (FoldPicture& picture : pictures) picture.draw(layer, a, b, c);
    }

    // The mesh around the support.
    void draw_mesh(NodeId node, Scratch& scratch) const {
        const auto draw_own = [&](Index t) {
            const Triangle& corners = triangles_[t];
            const Point own[3] = {leaf_point(corners[0]), leaf_point(corners[1]), leaf_point(corners[2])};
            draw(FoldPicture::Layer::mesh, own, scratch.pictures);
        };
        const Index first = first_triangle_[node],
                    end = first_triangle_[tree_.subtree_end()[node]]; // those that vanish in the support
        if (end - first > most_triangles_drawn) {
            for (const RingTriangle& t : scratch.ring.before)
                draw(FoldPicture::Layer::mesh, t.corner, scratch.pictures);
            return;
        }
        for (Index t = first; t < end; ++t) draw_own(t);
        for (const Index t : crossing_[node])
            if (t < first || t >= end) draw_own(t);
    }

    // Where two such surfaces differ most, they do so at a vertex or where two edges cross: looked at are the middles
    // of the edges that move, and of their halves. The vertices are among the samples.
    void compare(std::span<const RingTriangle> surface, const Surface& with, Scratch& scratch, Difference& worst,
                 Mean& mean) const {
        Points& points = scratch.points;
        if (with.empty()) return;
        points.clear();
        const std::size_t count = std::min(surface.size(), triangles_compared);
        for (std::size_t i = 0; i < count; ++i) {
            const RingTriangle& t = surface[i * surface.size() / count];
            for (std::size_t k = 0; k < 3; ++k) {
                if (!((t.inside >> k) & 1)) continue;
                const Point &a = t.corner[k], &b = t.corner[(k + 1) % 3], middle = middle_of(a, b);
                points.add(middle, t.sheet);
                points.add(middle_of(a, middle), t.sheet);
                points.add(middle_of(middle, b), t.sheet);
            }
        }
        with.compare(points, scratch.aside);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Difference here = difference(points, i, scratch);
            worst.include(here);
            if (i % 3 == 0) mean.include(here);
        }
    }

    static bool are_equal(std::span<const RingTriangle> a, std::span<const RingTriangle> b) {
        return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const RingTriangle& s, const RingTriangle& t) {
            return std::equal(s.corner, s.corner + 3, t.corner, [](const Point& p, const Point& q) {
                return p.position == q.position && std::ranges::equal(p.luminance, q.luminance);
            });
        });
    }

    static Point middle_of(const Point& a, const Point& b) {
        constexpr std::size_t registers = sizeof(Point) / sizeof(Float4);
        Float4 p[registers], q[registers];
        std::memcpy(p, &a, sizeof p);
        std::memcpy(q, &b, sizeof q);
        for (std::size_t i = 0; i < registers; ++i) p[i] = (p[i] + q[i]) * 0.5f;
        Point middle;
        std::memcpy(&middle, p, sizeof middle);
        return middle;
    }

    void add_samples(NodeId node, Scratch& scratch) const {
        const WedgeId first = tree_.first_wedge(node), leaves_from = tree_.interior_wedge_count();
        const auto add = [&](WedgeId wedge, Index leaf, bool is_typical) {
            const unsigned sheet = tree_.wedge_above(node, wedge) - first;
            scratch.samples.push_back({points_[wedge], sheet, leaf, is_typical, {}});
        };
        const auto add_leaf = [&](Index leaf, bool is_typical) { add(leaves_from + leaf, leaf, is_typical); };
        tree_.for_each_child(node, [&](NodeId child) {
            const WedgeId begin = tree_.first_wedge(child), wedges = tree_.wedge_end(child) - begin,
                          compared = std::min(wedges, most_wedges_compared);
            for (WedgeId i = 0; i < compared; ++i) {
                const WedgeId wedge = begin + static_cast<WedgeId>(std::uint64_t{wedges} * i / compared);
                add(wedge, tree_.is_place(child) ? wedge - leaves_from : none, false);
            }
            if (tree_.is_place(child)) return;
            for (const Index leaf : witnesses_[child])
                if (leaf != none) add_leaf(leaf, false);
        });
        const Index leaves = leaf_end_[node] - first_leaf_[node];
        const Index count = std::min(spread_count, leaves);
        for (Index i = 0; i < count; ++i)
            add_leaf(first_leaf_[node] + static_cast<Index>((std::uint64_t{leaves} * (2 * i + 1)) / (2 * count)), true);
    }

    void choose_witnesses(NodeId node, std::span<Sample> samples) {
        Witnesses& worst = witnesses_[node];
        worst.fill(none);
        const auto take = [&](std::size_t first, auto error) {
            for (std::size_t k = first; k < first + witness_count / 2; ++k) {
                const Sample* best = nullptr;
                for (const Sample& s : samples)
                    if (s.leaf != none && std::find(worst.begin(), worst.end(), s.leaf) == worst.end() &&
                        (!best || error(s) > error(*best)))
                        best = &s;
                if (best) worst[k] = best->leaf;
            }
        };
        take(0, [](const Sample& s) { return s.error.distance; });
        take(witness_count / 2, [](const Sample& s) { return s.error.largest_luminance(); });
    }

    const SoundTree& tree_;
    std::span<const TexturedLight> lights_; // by tree, with a texture
    std::span<MeasuredFolds> found_;        // by tree
    std::span<const Index> first_leaf_, leaf_end_, first_triangle_;
    std::span<const Triangle> triangles_;
    std::span<const Sphere> support_;
    NodeId interior_;
    PlaceTriangles mesh_;
    BorderShifts border_;
    FoldNeighbours<deciding> neighbours_;
    std::vector<std::vector<Index>> crossing_; // of nodes whose parent has not been measured yet
    std::vector<Contact> contacts_;
    std::vector<Witnesses> witnesses_;
    std::vector<Point> points_; // of wedges
    std::optional<Texture> texture_;
};

} // namespace unseen::perception
