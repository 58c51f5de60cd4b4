// The clusterers by themselves, on meshes of several parts and on hard ones: hierarchies that are whole, that do not
// depend on threads, in time that grows with the mesh, and that keep what the attributes show.
#include <unseen/vdtree/builder.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <numbers>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>
#include <tbb/global_control.h>

#include <unseen/vdtree/internal/team.h>

#include "build/quadric_contraction.h"
#include "build/quadric_setup.h"
#include "build/surface.h"
#include "build/triangle_rings.h"
#include "clustering_tools.h"
#include "shapes.h"
#include "testing.h"

namespace unseen::vdtree::clusterer_test {

using support::ClusteringTask;

// The first fault in a hierarchy over so many vertices; empty where there is none.
std::string fault(const Clustering& c, std::size_t vertices) {
    if (c.parents.size() <= vertices) return "no clusters";
    if (!c.positions.empty() && c.positions.size() != c.parents.size() - vertices) return "positions of another length";
    const std::size_t root = c.parents.size() - 1;
    if (c.parents[root] != root) return "the last cluster is not the root";
    std::vector<Index> children(c.parents.size(), 0);
    for (std::size_t i = 0; i < root; ++i) {
        if (c.parents[i] <= i || c.parents[i] > root || c.parents[i] < vertices)
            return "parent of " + std::to_string(i);
        ++children[c.parents[i]];
    }
    for (std::size_t i = vertices; i <= root; ++i)
        if (children[i] < 2)
            return "cluster " + std::to_string(i) + " has " + std::to_string(children[i]) + " children";
    for (const glm::dvec3& p : c.positions)
        if (!std::isfinite(p.x + p.y + p.z)) return "a position is not finite";
    for (std::size_t i = 0; i < c.deviations.size(); ++i) {
        if (!(c.deviations[i] >= 0) || std::isinf(c.deviations[i]))
            return "deviation of " + std::to_string(vertices + i);
        const std::size_t parent = c.parents[vertices + i];
        if (c.deviations[parent - vertices] < c.deviations[i])
            return "deviation falls above " + std::to_string(vertices + i);
    }
    return "";
}

std::size_t depth(const Clustering& c) {
    std::vector<std::size_t> depths(c.parents.size(), 0);
    for (std::size_t i = c.parents.size() - 1; i-- > 0;) depths[i] = depths[c.parents[i]] + 1;
    return *std::max_element(depths.begin(), depths.end());
}

Clustering clustered(const ClusteringTask& task, ClustererKind kind, const Progress& progress = {}) {
    Result<Clustering> made = kind == ClustererKind::octree ? cluster_octree(task.input(), progress)
                                                            : cluster_quadric(task.input(), progress);
    EXPECT_TRUE(made);
    return made ? std::move(*made) : Clustering{};
}

bool equal(const Clustering& a, const Clustering& b) {
    return a.parents == b.parents && a.positions == b.positions && a.deviations == b.deviations;
}

// n triangles around one vertex that share no edge.
Mesh star(Index n) {
    Mesh m;
    m.positions.emplace_back(0);
    std::mt19937_64 random(5);
    for (Index i = 0; i < n; ++i) {
        const glm::dvec3 d = shapes::random_direction(random);
        m.positions.push_back(d);
        m.positions.push_back(d + 0.001 * shapes::random_direction(random));
        m.triangles.push_back({0, 2 * i + 1, 2 * i + 2});
    }
    return m;
}

// Every `patch` triangles have texture coordinates of their own.
Mesh patched(const Mesh& mesh, Index patch) {
    Mesh m = shapes::unwelded(mesh);
    for (Index v = 0; v < m.positions.size(); ++v) {
        const float chart = static_cast<float>(v / 3 / patch);
        m.uvs.emplace_back(static_cast<float>(m.positions[v].x) + chart, static_cast<float>(m.positions[v].y));
    }
    return m;
}

// n triangles around one position, each with texture coordinates of its own there.
Mesh pole(Index n) {
    Mesh m;
    for (Index i = 0; i < n; ++i) {
        const auto rim = [&](Index k) {
            const double angle = 2 * std::numbers::pi * (k % n) / n;
            return glm::dvec3(std::cos(angle), std::sin(angle), 0);
        };
        m.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
        m.positions.insert(m.positions.end(), {{0, 0, 1}, rim(i), rim(i + 1)});
        const float u = static_cast<float>(i);
        m.uvs.insert(m.uvs.end(), {{u + 0.5f, 1}, {u, 0}, {u + 1, 0}});
    }
    return m;
}

constexpr Index large = 36000; // vertices enough for several parts

struct Hard {
    const char* name;
    std::function<Mesh()> make;
};
const Hard hard_meshes[] = {
    {"sphere of several parts", [] { return shapes::bumpy_sphere(6); }},
    {"flat grid", [] { return shapes::grid(280); }},
    {"random soup, every edge across parts", [] { return shapes::random_soup(large, 2 * large, 7); }},
    {"loose triangles", [] { return shapes::unwelded(shapes::bumpy_sphere(5)); }},
    {"star", [] { return star(large / 2); }},
    {"seams across parts", [] { return patched(shapes::bumpy_sphere(6), 16); }},
    {"a seam along every edge", [] { return patched(shapes::bumpy_sphere(6), 1); }},
    {"a pole with thousands of texture coordinates", [] { return pole(large / 4); }},
    {"one far vertex",
     [] {
         Mesh m = shapes::bumpy_sphere(6);
         m.positions[0] = {1e15, 0, 0};
         return m;
     }},
    {"scales over forty powers of ten",
     [] {
         std::mt19937_64 random(11);
         Mesh m;
         for (Index i = 0; i < large; ++i)
             m.positions.push_back(std::pow(10, shapes::random_between(random, -30, 10)) *
                                   shapes::random_direction(random));
         for (Index i = 0; i + 2 < large; i += 3) m.triangles.push_back({i, i + 1, i + 2});
         return m;
     }},
    {"no areas",
     [] {
         Mesh m;
         for (Index i = 0; i < large; ++i) m.positions.emplace_back(i, 0, 0);
         for (Index i = 0; i + 2 < large; ++i) m.triangles.push_back({i, i + 1, i + 2});
         return m;
     }},
};

TEST(Clusterers, AreWholeAndFastOnHardMeshesWhateverTheThreads) {
    for (const Hard& hard : hard_meshes) {
        const Mesh mesh = hard.make();
        const ClusteringTask task(mesh);
        for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
            SCOPED_TRACE(std::string(hard.name) + ", " + std::string(name(kind)));
            Clustering first;
            for (const std::size_t threads : {1u, 8u}) {
                const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
                const auto begin = std::chrono::steady_clock::now();
                Clustering made = clustered(task, kind);
                const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
                // Minutes, were it quadratic; with sanitizers and neighbours it takes a few seconds.
                EXPECT_LT(seconds.count(), 60);
                if (threads == 1) {
                    EXPECT_EQ(fault(made, task.places.mesh().positions.size()), "");
                    EXPECT_LE(depth(made), 200u);
                    first = std::move(made);
                } else {
                    EXPECT_TRUE(equal(first, made)) << threads << " threads";
                }
            }
        }
    }
}

// Members of a team that live in threads of this process. A message waits in the box of its two members, and who sends
// it waits, too: whatever the order that they take turns in, none may wait for each other.
class Mailboxes {
public:
    void put(int from, int to, std::span<const std::byte> message) {
        const std::lock_guard lock(mutex_);
        boxes_[{from, to}].emplace_back(message.begin(), message.end());
        arrived_.notify_all();
    }
    // Waits until the other one has taken everything; false where it does not.
    bool hand_over(int from, int to, std::span<const std::byte> message) {
        put(from, to, message);
        std::unique_lock lock(mutex_);
        constexpr std::chrono::seconds long_enough{120};
        return taken_.wait_for(lock, long_enough, [&] { return boxes_[{from, to}].empty(); });
    }
    std::vector<std::byte> take(int from, int to) {
        std::unique_lock lock(mutex_);
        auto& box = boxes_[{from, to}];
        arrived_.wait(lock, [&] { return !box.empty(); });
        std::vector<std::byte> message = std::move(box.front());
        box.pop_front();
        taken_.notify_all();
        return message;
    }
    bool all_empty() const {
        return std::all_of(boxes_.begin(), boxes_.end(), [](const auto& box) { return box.second.empty(); });
    }

private:
    std::mutex mutex_;
    std::condition_variable arrived_, taken_;
    std::map<std::pair<int, int>, std::deque<std::vector<std::byte>>> boxes_;
};

class ThreadTeam : public Team {
public:
    ThreadTeam(Mailboxes& mail, int rank, int size) : mail_(mail), rank_(rank), size_(size) {}
    int rank() const override { return rank_; }
    int size() const override { return size_; }
    void send(int to, std::span<const std::byte> message) override {
        EXPECT_TRUE(mail_.hand_over(rank_, to, message)) << "members wait for each other: " << rank_ << " for " << to;
    }
    std::vector<std::byte> receive(int from) override { return mail_.take(from, rank_); }

private:
    Mailboxes& mail_;
    int rank_, size_;
};

TEST(Clusterers, OfOnesOwnAreCheckedAndHaveNoTeam) {
    const Mesh mesh = shapes::single_triangle();
    const auto with_root = [&](Index root) {
        return build_tree(mesh.view(), [&](const ClusterInput&) -> Result<Clustering> {
            return Clustering{{3, 3, 3, root}, {}};
        });
    };
    EXPECT_TRUE(with_root(3));
    EXPECT_FALSE(with_root(0));
    EXPECT_FALSE(with_root(1000000));
    Mailboxes mail;
    ThreadTeam team(mail, 0, 2);
    bool was_called = false;
    const auto own = [&](const ClusterInput&) -> Result<Clustering> {
        was_called = true;
        return Clustering{{3, 3, 3, 3}, {}};
    };
    EXPECT_FALSE(build_tree(mesh.view(), own, {.team = &team}));
    EXPECT_FALSE(was_called);
}

TEST(Clusterers, MakeTheSameWithATeamOfAnySize) {
    for (const Hard& hard : hard_meshes) {
        SCOPED_TRACE(hard.name);
        const Mesh mesh = hard.make();
        const ClusteringTask task(mesh);
        const Clustering alone = clustered(task, ClustererKind::quadric);
        const bool is_first = &hard == hard_meshes; // of any size; the others of one
        for (const int members : is_first ? std::vector{1, 3, 40} : std::vector{3}) {
            Mailboxes mail;
            std::vector<std::thread> others;
            for (int rank = 1; rank < members; ++rank)
                others.emplace_back([&, rank] {
                    ThreadTeam team(mail, rank, members);
                    EXPECT_TRUE(cluster_quadric(task.input(), {}, &team));
                });
            ThreadTeam team(mail, 0, members);
            const auto together = cluster_quadric(task.input(), {}, &team);
            for (std::thread& other : others) other.join();
            ASSERT_TRUE(together) << together.error().message;
            EXPECT_TRUE(equal(alone, *together)) << members << " members";
            EXPECT_TRUE(mail.all_empty());
        }
    }
}

TEST(Clusterers, RefuseWhatIsNoMessageOfTheTeam) {
    const Mesh mesh = shapes::bumpy_sphere(7); // several parts
    const ClusteringTask task(mesh);
    for (const std::size_t length : {0u, 7u, 8u, 100u}) {
        Mailboxes mail;
        mail.put(1, 0, std::vector<std::byte>(length, std::byte{0xff}));
        ThreadTeam team(mail, 0, 2);
        const auto made = cluster_quadric(task.input(), {}, &team);
        ASSERT_FALSE(made);
        EXPECT_EQ(made.error().code, ErrorCode::malformed_data);
    }
}

TEST(Clusterers, ReportOnTheCallersThreadOnlyAndStopWhenToldTo) {
    const Mesh mesh = shapes::bumpy_sphere(6);
    const ClusteringTask task(mesh);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
    for (const ClustererKind kind : {ClustererKind::quadric, ClustererKind::octree}) {
        const std::thread::id caller = std::this_thread::get_id();
        std::atomic<int> elsewhere = 0;
        double last = 0;
        int calls = 0, most_calls = 1 << 30;
        const auto watch = [&](double share, const char*) {
            if (std::this_thread::get_id() != caller) ++elsewhere;
            EXPECT_GE(share, last);
            EXPECT_LE(share, 1);
            last = share;
            return ++calls <= most_calls;
        };
        clustered(task, kind, watch);
        EXPECT_EQ(elsewhere, 0);
        EXPECT_GT(calls, 2);
        most_calls = 2, calls = 0, last = 0;
        const auto stopped =
            kind == ClustererKind::octree ? cluster_octree(task.input(), watch) : cluster_quadric(task.input(), watch);
        ASSERT_FALSE(stopped);
        EXPECT_EQ(stopped.error().code, ErrorCode::cancelled);
        EXPECT_EQ(calls, 3);
    }
}

// A flat square whose right half has another colour, on a grid that the border does not favour.
Mesh two_colours(int n) {
    Mesh m = shapes::grid(n);
    glm::dvec3 low = m.positions[0], high = low;
    for (const glm::dvec3& p : m.positions) low = glm::min(low, p), high = glm::max(high, p);
    const double border = low.x + 0.37 * (high.x - low.x);
    for (const glm::dvec3& p : m.positions)
        m.colours.push_back(p.x < border ? glm::vec4(0.8f, 0.2f, 0.2f, 1) : glm::vec4(0.1f, 0.6f, 0.9f, 1));
    return m;
}

TEST(Quadric, FoldsWithinAColourBeforeAcrossColours) {
    const Mesh mesh = two_colours(40);
    const Clustering c = clustered(ClusteringTask(mesh), ClustererKind::quadric);
    const Mesh simple = support::simplified_by_deviation(mesh.view(), c, 400); // of 3200
    std::vector<std::uint8_t> colours(c.parents.size(), 0);                    // by cluster: which it holds
    for (Index v = 0; v < mesh.positions.size(); ++v) colours[v] = mesh.colours[v].r > 0.5f ? 1 : 2;
    for (std::size_t i = 0; i + 1 < colours.size(); ++i) colours[c.parents[i]] |= colours[i];
    std::size_t used = 0, mixed = 0;
    std::vector<std::uint8_t> seen(c.parents.size(), 0);
    for (const Triangle& t : simple.triangles) {
        for (const Index v : t) {
            if (seen[v]++) continue;
            ++used;
            mixed += colours[v] == 3;
        }
    }
    EXPECT_GT(used, 100u);
    EXPECT_EQ(mixed, 0u);
}

TEST(Quadric, HoldsTheSeamOfATexture) {
    // A flat square whose texture jumps along x = 0: two vertices at each position there.
    Mesh mesh;
    constexpr int n = 32;
    const auto add_side = [&](int first, int last, float shift) {
        const Index base = static_cast<Index>(mesh.positions.size()), columns = static_cast<Index>(last - first + 1);
        for (int j = 0; j <= n; ++j) {
            for (int i = first; i <= last; ++i) {
                mesh.positions.emplace_back(i, j, 0);
                mesh.uvs.emplace_back(shift + static_cast<float>(i) / n, static_cast<float>(j) / n);
            }
        }
        for (Index j = 0; j < n; ++j) {
            for (Index i = 0; i + 1 < columns; ++i) {
                const Index a = base + j * columns + i;
                mesh.triangles.push_back({a, a + 1, a + columns + 1});
                mesh.triangles.push_back({a, a + columns + 1, a + columns});
            }
        }
    };
    add_side(-n / 2, 0, 0);
    add_side(0, n / 2, 0.6f);
    const ClusteringTask task(mesh);
    const MeshView& places = task.places.mesh();
    const Clustering c = clustered(task, ClustererKind::quadric);
    const Mesh simple = support::simplified_by_deviation(places, c, 100); // of 2048
    // Whatever holds a vertex of the seam lies on it still.
    std::vector<std::uint8_t> holds_seam(c.parents.size(), 0);
    for (Index v = 0; v < places.positions.size(); ++v) holds_seam[v] = places.positions[v].x == 0;
    for (std::size_t i = 0; i + 1 < holds_seam.size(); ++i) holds_seam[c.parents[i]] |= holds_seam[i];
    std::size_t on_seam = 0;
    for (const Triangle& t : simple.triangles) {
        for (const Index v : t) {
            if (!holds_seam[v]) continue;
            ++on_seam;
            EXPECT_NEAR(simple.positions[v].x, 0, 0.05); // squares are 1 wide
        }
    }
    EXPECT_GT(on_seam, 2u);
}

// n x n squares a side, turned, with hard edges: each side has vertices of its own.
Mesh hard_cube(int n) {
    Mesh m;
    const glm::dmat3 turn(glm::dvec3(0.36, 0.48, -0.8), glm::dvec3(-0.8, 0.6, 0), glm::dvec3(0.48, 0.64, 0.6));
    for (int side = 0; side < 6; ++side) {
        const int axis = side / 2;
        const double sign = side % 2 == 0 ? -1 : 1;
        const Index first = static_cast<Index>(m.positions.size()), row = static_cast<Index>(n) + 1;
        for (int i = 0; i <= n; ++i) {
            for (int j = 0; j <= n; ++j) {
                glm::dvec3 p, normal(0);
                p[axis] = normal[axis] = sign;
                p[(axis + 1) % 3] = 2.0 * i / n - 1;
                p[(axis + 2) % 3] = sign * (2.0 * j / n - 1);
                m.positions.push_back(turn * p);
                m.normals.emplace_back(turn * normal);
            }
        }
        for (Index i = 0; i + 1 < row; ++i) {
            for (Index j = 0; j + 1 < row; ++j) {
                const Index a = first + i * row + j;
                m.triangles.push_back({a, a + row, a + row + 1});
                m.triangles.push_back({a, a + row + 1, a + 1});
            }
        }
    }
    return m;
}

TEST(Quadric, FoldsACubeToItsTwelveTriangles) {
    const Mesh mesh = hard_cube(40);
    const ClusteringTask task(mesh);
    const Clustering c = clustered(task, ClustererKind::quadric);
    const Mesh simple = support::simplified_by_deviation(task.places.mesh(), c, 12);
    EXPECT_EQ(simple.triangles.size(), 12u);
    constexpr double cosine = 0.5773502691896258; // of the angle between a side's normal and a corner's direction
    for (const Triangle& t : simple.triangles) {
        for (const Index v : t) {
            double nearest = 2;
            for (Index corner = 0; corner < mesh.positions.size(); ++corner)
                if (glm::dot(glm::normalize(mesh.positions[corner]), glm::dvec3(mesh.normals[corner])) < cosine + 1e-6)
                    nearest = std::min(nearest, glm::distance(mesh.positions[corner], simple.positions[v]));
            EXPECT_LT(nearest, 2e-7);
        }
    }
}

TEST(Quadric, KeepsLooseTrianglesThatAreSpreadOut) {
    // Small triangles along a line, in pairs of close ones: half of them can go while one of each pair stays.
    Mesh mesh;
    constexpr Index pairs = 64;
    for (Index i = 0; i < 2 * pairs; ++i) {
        const double x = 10.0 * (i / 2) + (i % 2) * 1.5;
        const Index first = static_cast<Index>(mesh.positions.size());
        mesh.positions.emplace_back(x, 0, 0);
        mesh.positions.emplace_back(x + 0.5, 0, 0);
        mesh.positions.emplace_back(x, 0.5, 0);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    const Clustering c = clustered(ClusteringTask(mesh), ClustererKind::quadric);
    const Mesh simple = support::folded(mesh.view(), c, 3); // above the gaps within the pairs, below those between them
    std::vector<int> left(pairs, 0);
    for (const Triangle& t : simple.triangles) ++left[static_cast<std::size_t>(simple.positions[t[0]].x / 10)];
    for (const int n : left) EXPECT_EQ(n, 1);
}

// Both halves of a strip of squares along x, as two parts.
struct Strip {
    PartMesh left, right;
};
Strip strip(Index columns) {
    Strip s;
    for (const bool is_right : {false, true}) {
        PartMesh& part = is_right ? s.right : s.left;
        const Index own = columns,
                    ghosts = 2; // columns / 2 columns of two slots each, and the next one of the other side
        part.first_slot = part.first_leaf = is_right ? columns : 0;
        part.own_slots = part.own_leaves = own;
        part.classes = {{1}, 1};
        const Index other = is_right ? columns - 2 : columns;
        part.ghost_leaves = {other, other + 1};
        const auto push = [&](Index slot) {
            part.positions.push_back(glm::dvec3(slot / 2, slot % 2, 0.1 * std::sin(slot / 2)) /
                                     static_cast<double>(columns));
            part.slot_of_leaf.push_back(static_cast<Index>(part.positions.size() - 1));
            part.channel_values.push_back(0);
        };
        for (Index i = 0; i < own; ++i) push(part.first_slot + i);
        for (Index i = 0; i < ghosts; ++i) push(part.ghost_leaves[i]);
        const auto square = [&](Index a, Index b) { // columns that begin with local slots a and b
            part.triangles.push_back({a, b, b + 1});
            part.triangles.push_back({a, b + 1, a + 1});
        };
        for (Index i = 0; i + 2 < own; i += 2) square(i, i + 2);
        is_right ? square(own, 0) : square(own - 2, own);
        part.area_scale = columns * columns;
    }
    return s;
}

TEST(QuadricParts, KeepTheEdgesThatLeaveThemUntilTheyAreJoined) {
    const Strip s = strip(16);
    const auto go_on = [](std::size_t) { return true; };
    const Contraction left = contract_part(s.left, 6, go_on), right = contract_part(s.right, 6, go_on);
    EXPECT_LE(left.live.size(), 6u);
    EXPECT_EQ(left.record.merges.size() + left.live.size(), 16u);
    ASSERT_FALSE(left.outer_edges.empty());
    for (const auto& edge : left.outer_edges) EXPECT_TRUE(edge.far_leaf == 16 || edge.far_leaf == 17);
    ASSERT_EQ(left.border_leaves.size(), 2u);
    EXPECT_EQ(left.border_leaves[0].leaf, 14u);
    EXPECT_EQ(left.border_leaves[1].leaf, 15u);

    // Joined without any contraction, the edges between the two are pairs now.
    const Contraction both = join(left, right, 100, go_on);
    EXPECT_TRUE(both.record.merges.empty());
    EXPECT_TRUE(both.outer_edges.empty());
    EXPECT_EQ(both.live.size(), left.live.size() + right.live.size());
    const auto shift = static_cast<Index>(left.live.size());
    EXPECT_TRUE(std::any_of(both.pairs.begin(), both.pairs.end(),
                            [&](const ClusterPair& p) { return p.a < shift && p.b >= shift; }));

    const Contraction all = join(left, right, 1, go_on);
    EXPECT_EQ(all.live.size(), 1u);
    EXPECT_EQ(all.record.merges.size() + left.record.merges.size() + right.record.merges.size(), 31u);
    EXPECT_EQ(all.record.round_ends.back(), all.record.merges.size());
}

TEST(QuadricParts, StopWhenToldTo) {
    const Strip s = strip(64);
    int rounds = 0;
    const Contraction c = contract_part(s.left, 1, [&](std::size_t) { return ++rounds < 2; });
    EXPECT_EQ(rounds, 2);
    EXPECT_GT(c.live.size(), 1u);
}

// A flat square of 3 x 3 places.
PartMesh square() {
    PartMesh part;
    part.own_slots = part.own_leaves = 9;
    part.classes = {{1}, 1};
    for (Index i = 0; i < 9; ++i) {
        part.positions.emplace_back(i % 3, i / 3, 0);
        part.slot_of_leaf.push_back(i);
        part.channel_values.push_back(0);
    }
    for (const Index a : {0, 1, 3, 4}) {
        part.triangles.push_back({a, a + 1, a + 4});
        part.triangles.push_back({a, a + 4, a + 3});
    }
    return part;
}

TEST(QuadricParts, KnowWhichMergesTurnTrianglesOver) {
    const Contraction c = set_up(square());
    TriangleRings rings(c);
    rings.start();
    EXPECT_FALSE(rings.turns(4, 5, {1.5, 1, 0}));
    EXPECT_TRUE(rings.turns(4, 5, {-0.5, 1, 0})); // beyond what is around the middle
    EXPECT_TRUE(rings.turns(4, 5, {1.2, 1, 4}));  // too steep
    rings.unite(4, 5, {1.5, 1, 0});
    EXPECT_FALSE(rings.turns(4, 3, {0.5, 1, 0}));
    EXPECT_TRUE(rings.turns(4, 3, {1, 2.5, 0}));
    const std::vector<Index> tags{0, 1, 2, 3, 4, 6, 7, 8};
    EXPECT_EQ(rings.left(tags).size(), 6u);
}

TEST(QuadricParts, KeepBothSidesOfASeamApart) {
    // Two leaves at each place of the middle column, with different values in the first class and the same in the second.
    PartMesh part = square();
    part.classes = {{1, 1}, 2};
    part.own_leaves = 12;
    part.slot_of_leaf = {0, 1, 1, 2, 3, 4, 4, 5, 6, 7, 7, 8};
    part.channel_values.clear();
    for (const float first : {0.f, 0.f, 1.f, 1.f, 0.f, 0.f, 1.f, 1.f, 0.f, 0.f, 1.f, 1.f})
        part.channel_values.insert(part.channel_values.end(), {first, 0.5f});
    const auto leaf = [](Index slot, bool right) {
        return slot / 3 * 4 + (slot % 3 == 0 ? 0 : slot % 3 == 2 ? 3 : right ? 2 : 1);
    };
    for (std::size_t t = 0; t < part.triangles.size(); ++t)
        for (Index& corner : part.triangles[t]) corner = leaf(corner, t / 2 % 2 == 1);
    const auto go_on = [](std::size_t) { return true; };
    const Contraction c = contract_part(part, 3, go_on);
    ASSERT_EQ(c.live.several.size(), c.live.size());
    int seen = 0;
    for (Index s = 0; s < c.live.size(); ++s) {
        if (c.live.is_simple(s)) continue;
        ++seen;
        const auto components = std::span(c.live.components).subspan(c.live.several[s].first, c.live.several[s].count);
        ASSERT_EQ(components.size(), 3u); // one of the second class
        for (const ClassComponent& component : components) {
            if (component.attribute_class == 0) EXPECT_NEAR(std::abs(component.references[0] - 0.5f), 0.5f, 1e-5f);
            else EXPECT_EQ(component.references[0], 0.5f);
        }
    }
    EXPECT_GT(seen, 0);
}

} // namespace unseen::vdtree::clusterer_test
