#include "build/surface.h"

#include <bit>
#include <numeric>
#include <tuple>

#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/vectors.h>

#include "build/spatial_order.h"

namespace unseen::vdtree {

namespace {

constexpr std::size_t grain =
    4096; // vertices or triangles of a task; sums are added up by these, on any number of threads

FaceVector face_vector(const MeshView& mesh, const Triangle& t) {
    const glm::dvec3& a = mesh.positions[t[0]];
    const glm::dvec3 vector = glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
    return {vector, glm::length(vector)};
}

bool has_length(glm::vec3 v) {
    const float sum = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
    return sum > 0 && std::isfinite(sum);
}

// The sum of f(0) .. f(count - 1), the same on any number of threads.
template <class F>
double sum(std::size_t count, F&& f) {
    const TaskOrder order;
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, count, grain), 0.0,
        [&](const tbb::blocked_range<std::size_t>& range, double total) {
            const TaskOrder::Task task(order);
            for (std::size_t i = range.begin(); i < range.end(); ++i) total += f(i);
            return total;
        },
        std::plus<double>());
}

double signed_volume(const MeshView& mesh, std::span<const FaceVector> faces) {
    return sum(faces.size(), [&](std::size_t t) {
        const glm::dvec3 from_origin = mesh.positions[mesh.triangles[t][0]] - mesh.positions[mesh.triangles[0][0]];
        return glm::dot(from_origin, faces[t].vector) / 6;
    });
}

// ---- coincident vertices

std::uint64_t hash(glm::dvec3 p) {
    // Adding 0 makes one zero of two.
    const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x + 0.0); };
    const auto mix = [](std::uint64_t h) {
        h ^= h >> 32;
        h *= 0xd6e8feb86659fd93u;
        return h ^ (h >> 32);
    };
    return mix(bits(p.x) + mix(bits(p.y) + mix(bits(p.z)) * 3) * 5);
}

// ---- around each place

// Looks at the corners at one place after another.
class Fan {
public:
    explicit Fan(std::span<const Triangle> triangles) : triangles_(triangles) {}

    // Whether every edge at the place has two triangles that run it in opposite ways: each neighbour follows once and
    // precedes once.
    bool is_regular(Index place, std::span<const Index> corners) {
        const std::uint64_t stamp = std::uint64_t{place} << 32;
        for (const Index corner : corners) {
            const Index following = at(corner, 1);
            std::uint64_t& seen = slot(following);
            if ((seen & stamp_mask) == stamp) return is_regular_by_sorting(corners); // seen twice, or two in one slot
            seen = stamp | following;
        }
        for (const Index corner : corners) {
            const Index preceding = at(corner, 2);
            std::uint64_t& seen = slot(preceding);
            if (seen != (stamp | preceding)) return false;
            seen = stamp | nobody; // only once
        }
        return true;
    }

private:
    static constexpr unsigned slot_bits = 8; // few neighbours rarely meet in so many
    static constexpr std::uint64_t nobody = ~Index{0}, stamp_mask = ~nobody;

    std::uint64_t& slot(Index v) { return slots_[v * 0x9e3779b1u >> (32 - slot_bits)]; }

    // The place at a corner's triangle so many corners farther.
    Index at(Index corner, Index farther) const { return triangles_[corner / 3][(corner % 3 + farther) % 3]; }

    bool is_regular_by_sorting(std::span<const Index> corners) {
        following_.clear();
        preceding_.clear();
        for (const Index corner : corners) {
            following_.push_back(at(corner, 1));
            preceding_.push_back(at(corner, 2));
        }
        std::sort(following_.begin(), following_.end());
        std::sort(preceding_.begin(), preceding_.end());
        return following_ == preceding_ && std::adjacent_find(following_.begin(), following_.end()) == following_.end();
    }

    std::span<const Triangle> triangles_;
    std::vector<Index> following_, preceding_;
    // Neighbours in the lower halves, stamped with the place where they were seen; at first with no place's stamp.
    std::vector<std::uint64_t> slots_ = std::vector(std::size_t{1} << slot_bits, ~std::uint64_t{0});
};

Closedness find_closedness(const MeshView& mesh, const Surface& surface) {
    if (mesh.triangles.empty() || std::ranges::find(surface.irregular, 1) != surface.irregular.end())
        return Closedness::open;
    const double volume = signed_volume(mesh, surface.faces);
    return volume > 0 ? Closedness::closed_outward : volume < 0 ? Closedness::closed_inward : Closedness::open;
}

} // namespace

std::vector<Index> find_coincident(std::span<const glm::dvec3> positions) {
    // Sorted by a part of the hash, and among those that have it in common by position.
    constexpr unsigned left_out = 24; // bits
    std::vector<CodedIndex> order(positions.size()), scratch(positions.size());
    parallel_loop(std::size_t{0}, positions.size(), [&](std::size_t v) {
        order[v] = {hash(positions[v]) >> left_out, static_cast<Index>(v)};
    });
    sort_by_code(order, scratch);
    std::vector<Index> first(positions.size());
    for (auto run = order.begin(); run != order.end();) {
        const auto end = std::find_if(run, order.end(), [&](const CodedIndex& v) { return v.code != run->code; });
        if (end - run > 1)
            std::stable_sort(run, end, [&](const CodedIndex& a, const CodedIndex& b) {
                const glm::dvec3 &p = positions[a.index], &q = positions[b.index];
                return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
            });
        for (auto v = run; v != end; ++v) {
            const bool is_same = v != run && positions[v->index] == positions[(v - 1)->index];
            first[v->index] = is_same ? first[(v - 1)->index] : v->index;
        }
        run = end;
    }
    return first;
}

CornersByPlace::CornersByPlace(std::span<const Triangle> triangles, std::size_t places)
    : start_(places + 1, 0), corners_(3 * triangles.size(), Unfilled()) {
    // Each thread looks at all triangles, for a range of the places: they are soon seen, and collecting is what takes
    // time.
    constexpr int most_ranges = 8;
    const auto ranges = static_cast<std::size_t>(std::min(tbb::this_task_arena::max_concurrency(), most_ranges));
    const auto for_each_corner = [&](auto&& use) {
        parallel_loop(std::size_t{0}, ranges, [&](std::size_t r) {
            const std::size_t begin = places * r / ranges, size = places * (r + 1) / ranges - begin;
            for (std::size_t t = triangles.size(); t-- > 0;)
                for (std::size_t k = 3; k-- > 0;)
                    if (triangles[t][k] - begin < size) use(start_[triangles[t][k]], static_cast<Index>(3 * t + k));
        });
    };
    for_each_corner([](Index& count, Index) { ++count; });
    std::partial_sum(start_.begin(), start_.end(), start_.begin());
    for_each_corner([&](Index& end, Index corner) { corners_[--end] = corner; });
}

Surface analyse_surface(const MeshView& mesh) {
    const std::size_t places = mesh.positions.size();
    Surface surface;
    surface.irregular.resize(places);
    surface.areas.resize(places);
    surface.normals.resize(places);
    surface.faces = ParallelArray<FaceVector>(mesh.triangles.size(), Unfilled());
    parallel_loop(std::size_t{0}, mesh.triangles.size(),
                  [&](std::size_t t) { surface.faces[t] = face_vector(mesh, mesh.triangles[t]); });
    surface.corners = CornersByPlace(mesh.triangles, places);
    parallel_loop_over(tbb::blocked_range<std::size_t>(0, places, grain), [&](const auto& range) {
        Fan fan(mesh.triangles);
        for (std::size_t place = range.begin(); place < range.end(); ++place) {
            const std::span<const Index> corners = surface.corners.at(place);
            surface.irregular[place] = !fan.is_regular(static_cast<Index>(place), corners);
            glm::dvec3 sum(0);
            double area = 0;
            for (const Index corner : corners) {
                const FaceVector& face = surface.faces[corner / 3];
                sum += face.vector;
                area += face.length / 6; // a third of the triangle's
            }
            surface.areas[place] = area;
            surface.normals[place] = glm::vec3(unit(sum));
        }
    });
    surface.closedness = find_closedness(mesh, surface);
    if (surface.closedness == Closedness::closed_inward)
        for (glm::vec3& normal : surface.normals) normal = -normal;
    return surface;
}

bool own_normals_agree(const MeshView& mesh) {
    if (mesh.normals.empty()) return false;
    return sum(mesh.triangles.size(), [&](std::size_t t) {
               const glm::dvec3 area = face_vector(mesh, mesh.triangles[t]).vector;
               double agreement = 0;
               for (const Index v : mesh.triangles[t])
                   if (has_length(mesh.normals[v])) agreement += glm::dot(area, unit(glm::dvec3(mesh.normals[v])));
               return agreement;
           }) > 0;
}

} // namespace unseen::vdtree
