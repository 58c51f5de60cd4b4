// unseen-bench accuracy, on a mesh so small that the figures mean little: every axis is there, with its default.
#include <glm/vec3.hpp>

#include "run_bench.h"

namespace accuracy_bench_test {

using namespace unseen::app::testing;

class AccuracyBenchTest : public BenchTest {
protected:
    static Json named(const Json& points, const std::string& name) {
        const auto found = std::ranges::find_if(points, [&](const Json& p) { return p["name"] == name; });
        if (found == points.end()) ADD_FAILURE() << "no point '" << name << "'";
        return found == points.end() ? Json() : *found;
    }
    static double cost(const Json& points, const std::string& name) { return named(points, name)["values"][0]; }
    static double error(const Json& points, const std::string& name) { return named(points, name)["values"][1]; }

    // The axes that have points, all of which have a front and a default.
    static std::set<std::string> sound_axes(const Json& report) {
        std::set<std::string> axes, with_default, with_front;
        for (const Json& point : report["points"]) {
            const std::string axis = point["axis"];
            axes.insert(axis);
            if (point["default"]) with_default.insert(axis);
            if (point["pareto"]) with_front.insert(axis);
            EXPECT_GE(point["values"][0], 0) << point;
            EXPECT_GE(point["values"][1], 0) << point;
        }
        EXPECT_EQ(with_default, axes);
        EXPECT_EQ(with_front, axes);
        EXPECT_EQ(report["axes"].size(), axes.size());
        return axes;
    }
};

TEST_F(AccuracyBenchTest, EveryAxisHasAFrontAndADefault) {
    write_ball("ball.obj");
    const Outcome outcome = bench({"accuracy", "--quick", "ball.obj", "--seconds", "5", "--window", "96", "--csv",
                                   "points.csv", "--plots", "plots", "--json", "-"});
    if (outcome.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << outcome.err;
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    const Json& points = report["points"];
    EXPECT_EQ(sound_axes(report), (std::set<std::string>{"csf", "cut", "facing", "folds", "gaze", "maps", "measurement",
                                                         "spheres", "tests", "trees"}))
        << "levels and pictures of depth are of scenes";
    EXPECT_EQ(error(points, "closed form, double"), 0);
    EXPECT_LT(error(points, "the program's table"), 0.005) << "what csf.h promises";
    EXPECT_GT(error(points, "table, 16 an axis, linear"), error(points, "table, 64 an axis, linear"));
    EXPECT_EQ(error(points, "imperceptible, followed"), 0) << "what a cut becomes does not depend on the way to it";
    EXPECT_EQ(error(points, "full"), 0);
    EXPECT_LT(error(points, "imperceptible"), 1) << "in thresholds";
    EXPECT_LE(error(points, "modern"), 1e-3) << "what <unseen/render/internal/visibility_passes.h> promises";
    EXPECT_EQ(error(points, "modern, CPU"), 0);
    EXPECT_LT(error(points, "16 frames old, margin of 8 deg"), 1) << "what a margin promises";
    EXPECT_EQ(named(points, "quadric, one thread")["values"][1], named(points, "quadric, two threads")["values"][1]);
    // Choices that nothing above looks at.
    for (const char* name : {"luebke-hallen",
                             "luebke-hallen-safe",
                             "1 px, extent",
                             "1 px, displacement",
                             "imperceptible, threshold 2",
                             "imperceptible, by this picture",
                             "budget of 5%",
                             "discrete levels, where nobody sees them",
                             "table, 16 an axis, cubic",
                             "table, 32 an axis, linear",
                             "table, 32 an axis, cubic",
                             "table, 64 an axis, cubic",
                             "around the centroid",
                             "Ritter",
                             "mask of 6 x 4 x 4",
                             "mask of 6 x 12 x 12",
                             "slabs",
                             "cone",
                             "without conserving light",
                             "without stages",
                             "modern, 1 band",
                             "modern, 5 bands",
                             "rpg99",
                             "imperceptible, from scratch",
                             "imperceptible, followed, 1 ms at most",
                             "budget, exact",
                             "budget, hysteresis 2",
                             "double",
                             "octree, all cores",
                             "of this frame",
                             "4 frames old"})
        named(points, name);
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(read_text(path("points.csv")), '\n')), points.size() + 1);
    for (const Json& axis : report["axes"])
        EXPECT_TRUE(std::filesystem::exists(path("plots/accuracy_" + axis["key"].get<std::string>() + ".png")));
}

TEST_F(AccuracyBenchTest, BoundsHoldAndTighterOnesCostMore) {
    write_ball("ball.obj");
    const Outcome outcome =
        bench({"accuracy", "ball.obj", "--only", "spheres", "--only", "facing", "--window", "96", "--json", "-"});
    if (outcome.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << outcome.err;
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    const Json& points = report["points"];
    EXPECT_EQ(sound_axes(report), (std::set<std::string>{"facing", "spheres"}));
    constexpr double rounding = 1e-6; // of the tree's floats
    for (const Json& point : points) {
        if (point["axis"] == "facing") EXPECT_EQ(point["values"][2], 0) << "no silhouette is missed: " << point;
        else EXPECT_LE(point["values"][3], rounding) << "nothing is outside: " << point;
    }
    EXPECT_LE(error(points, "Welzl, of points"), 1e-12);
    EXPECT_LE(error(points, "Ritter"), 0.2) << "what Ritter says of his spheres, and more";
    EXPECT_EQ(error(points, "each triangle, exact"), 0);
    EXPECT_GE(error(points, "mask of 6 x 2 x 2"), error(points, "mask of 6 x 8 x 8"));
    EXPECT_GE(error(points, "mask of 6 x 8 x 8"), error(points, "mask of 6 x 16 x 16"));
    EXPECT_GE(error(points, "slabs"), error(points, "slabs, then mask of 6 x 8 x 8"));
}

TEST_F(AccuracyBenchTest, ScenesHaveLevels) {
    ASSERT_EQ(run({"make", "scene", "museum", "--triangles", "10000", "-o", "museum.glb"}).status, 0);
    const Outcome outcome =
        bench({"accuracy", "--quick", "museum.glb", "--only", "levels", "--window", "96", "--json", "-"});
    if (outcome.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << outcome.err;
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(sound_axes(outcome.json()), std::set<std::string>{"levels"});
}

// A cube whose sides are grids with a normal each: nothing of it shows, bends or moves down to a tenth.
TEST_F(AccuracyBenchTest, HardEdgesStayHard) {
    constexpr int cells = 8;
    std::ostringstream obj;
    int vertices = 0;
    for (int side = 0; side < 6; ++side) {
        glm::dvec3 axes[3] = {};
        for (int i = 0; i < 3; ++i) axes[i][(side / 2 + i) % 3] = i == 0 && side % 2 ? -1 : 1;
        if (side % 2) std::swap(axes[1], axes[2]);
        obj << "vn " << axes[0].x << ' ' << axes[0].y << ' ' << axes[0].z << '\n';
        for (int i = 0; i <= cells; ++i)
            for (int j = 0; j <= cells; ++j) {
                const glm::dvec3 p = axes[0] + (2.0 * i / cells - 1) * axes[1] + (2.0 * j / cells - 1) * axes[2];
                obj << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
            }
        for (int i = 0; i < cells; ++i)
            for (int j = 0; j < cells; ++j) {
                obj << 'f';
                for (const auto& [down, across] : {std::pair{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}})
                    obj << ' ' << vertices + 1 + down * (cells + 1) + across << "//" << side + 1;
                obj << '\n';
            }
        vertices += (cells + 1) * (cells + 1);
    }
    std::ofstream(path("box.obj")) << obj.str();
    const Outcome outcome =
        bench({"accuracy", "box.obj", "--only", "corners", "--window", "96", "--plots", "plots", "--json", "-"});
    if (outcome.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << outcome.err;
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const Json report = outcome.json();
    for (const std::string share : {"half", "30%", "a tenth"}) {
        const Json values = named(report["points"], "ours, " + share)["values"];
        EXPECT_LE(values[0], 6 * 2 * cells * cells / 2) << share;
        EXPECT_EQ(values[1], 0) << share << ": pixels";
        EXPECT_EQ(values[4], 0) << share << ": corners whose normals are off their face";
        EXPECT_LT(values[5], 1) << share << ": millionths";
    }
    EXPECT_TRUE(std::filesystem::exists(path("plots/corners_box.png")));
}

TEST_F(AccuracyBenchTest, NamesTheAxesThatThereAre) {
    const Outcome outcome = bench({"accuracy", "--only", "colour"});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("colour"));
    EXPECT_THAT(outcome.err, HasSubstr("spheres"));
}

} // namespace accuracy_bench_test
