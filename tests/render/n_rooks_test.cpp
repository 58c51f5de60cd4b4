// The sample pattern, which needs no GL.
#include <unseen/render/sample_sum.h>

#include "testing.h"

namespace {

using unseen::render::n_rooks;

TEST(NRooks, PutsOnePointInEachRowAndEachColumn) {
    for (int n : {1, 2, 3, 7, 16, 64, 256})
        for (std::uint32_t seed : {0u, 1u, 2u, 0xffffffffu}) {
            const auto points = n_rooks(n, seed);
            ASSERT_EQ(points.size(), static_cast<std::size_t>(n));
            std::set<int> columns, rows;
            for (glm::dvec2 p : points) {
                ASSERT_TRUE(p.x > 0 && p.x < 1 && p.y > 0 && p.y < 1);
                columns.insert(static_cast<int>(p.x * n));
                rows.insert(static_cast<int>(p.y * n));
            }
            EXPECT_EQ(columns.size(), points.size()) << "n " << n << ", seed " << seed;
            EXPECT_EQ(rows.size(), points.size()) << "n " << n << ", seed " << seed;
        }
}

TEST(NRooks, PutsPointsAtTheCentresOfTheirCells) {
    for (glm::dvec2 p : n_rooks(16, 1)) {
        EXPECT_EQ(p.x * 32, std::floor(p.x * 32));
        EXPECT_EQ(static_cast<int>(p.x * 32) % 2, 1);
        EXPECT_EQ(p.y * 32, std::floor(p.y * 32));
        EXPECT_EQ(static_cast<int>(p.y * 32) % 2, 1);
    }
}

TEST(NRooks, IsOnePointAtTheCentreForOneSample) {
    ASSERT_EQ(n_rooks(1, 5).size(), 1u);
    EXPECT_EQ(n_rooks(1, 5)[0], glm::dvec2(0.5));
}

TEST(NRooks, DependsOnTheSeedAlone) {
    EXPECT_EQ(n_rooks(16, 1), n_rooks(16, 1));
    EXPECT_NE(n_rooks(16, 1), n_rooks(16, 2));
}

// Images that are compared may have been made by different builds: the pattern of seed 1 is part of the format. The
// rows are those of a Fisher-Yates shuffle driven by SplitMix64(1), worked out independently of this code.
TEST(NRooks, IsTheSameWithEveryCompiler) {
    const int rows[16] = {2, 11, 10, 6, 7, 13, 14, 0, 12, 5, 15, 9, 3, 8, 4, 1};
    const auto points = n_rooks(16, 1);
    for (std::size_t column = 0; column < 16; ++column)
        EXPECT_EQ(static_cast<int>(points[column].y * 16), rows[column]) << "column " << column;
}

TEST(NRooks, HasNoPointsForNoSamples) {
    EXPECT_TRUE(n_rooks(0, 1).empty());
    EXPECT_TRUE(n_rooks(-3, 1).empty());
}

} // namespace
