// What people do with a mesh of another program: simplify it, open what comes out, and compare both.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "run_command.h"

namespace unseen::app::testing {

class UserFileTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        // A mesh is taken several times: as by people, its tree is built at the first, here in the test's own folder.
        ::setenv("UNSEEN_CACHE", path("cache").c_str(), 1);
    }

    // Where from, for all that is done with the model: half a window of the default display, 15 degrees high.
    Words view = {"--size", "512x512", "--eye", "0", "0.8", "10", "--target", "0", "0", "0"};

    std::string succeed(Words words) const {
        const Outcome outcome = run(words);
        EXPECT_EQ(outcome.status, 0) << ::testing::PrintToString(words) << outcome.err;
        return outcome.out + outcome.err;
    }
    std::string refused(const Words& words) const {
        const Outcome outcome = run(words);
        EXPECT_NE(outcome.status, 0) << ::testing::PrintToString(words) << outcome.out;
        EXPECT_THAT(outcome.err, IsAnErrorForPeople());
        return outcome.err;
    }

    struct Simplified {
        std::string said;
        Json report;
    };
    // With the default request, or another.
    Simplified simplify(const std::string& file, const std::string& out, Words more = {}) const {
        Words words = joined({"simplify", file, "-o", out, "--json", out + ".json"}, more);
        words.insert(words.end(), view.begin(), view.end());
        const std::string said = succeed(words);
        return {said, Json::parse(read_text(path(out + ".json")), nullptr, false)};
    }
    ::testing::AssertionResult look_the_same(const std::string& a, const std::string& b) const {
        Words words = view;
        words.insert(words.end(), {"--samples", "16"});
        return CommandTest::look_the_same(a, b, words);
    }

    // Simplifies what nobody sees into small.ENDING and copies into whole.ENDING, below the folder out/: from where it
    // was asked for, nobody sees a difference to the file. (Of contrasty textures that may be nothing.)
    void expect_invisible(const std::string& file, const std::string& ending, const Words& more = {}) const {
        for (const bool is_whole : {false, true}) {
            SCOPED_TRACE(is_whole ? "--full" : "the default request");
            const std::string out = (is_whole ? "out/whole." : "out/small.") + ending;
            Words words = more;
            if (is_whole) words.push_back("--full");
            const Simplified made = simplify(file, out, words);
            ASSERT_TRUE(made.report.is_object());
            const unsigned kept = made.report["triangles"], all = made.report["source_triangles"];
            if (is_whole) EXPECT_EQ(kept, all);
            else EXPECT_LE(kept, all);
            EXPECT_TRUE(look_the_same(file, out));
        }
    }
};

// A surface over two parameters, as people model: rows of quads, each of two triangles.
struct Patch {
    int columns, rows; // of quads
    std::vector<std::array<double, 3>> positions, normals;
    std::vector<std::array<double, 2>> uvs; // 0..1, v upward
    std::vector<std::array<int, 3>> triangles;

    // `place`: from u and v to a position.
    template <class Place>
    Patch(int columns_, int rows_, Place&& place) : columns(columns_), rows(rows_) {
        for (int r = 0; r <= rows; ++r)
            for (int c = 0; c <= columns; ++c) {
                const double u = static_cast<double>(c) / columns, v = static_cast<double>(r) / rows, step = 1e-5;
                uvs.push_back({u, v});
                positions.push_back(place(u, v));
                const double inside = std::clamp(v, 2 * step, 1 - 2 * step); // poles have a normal, too
                const auto right = place(u + step, inside), left = place(u - step, inside),
                           above = place(u, inside + step), below = place(u, inside - step);
                std::array<double, 3> along{}, across{}, n{};
                for (std::size_t k = 0; k < 3; ++k) along[k] = right[k] - left[k], across[k] = above[k] - below[k];
                for (std::size_t k = 0; k < 3; ++k)
                    n[k] = along[(k + 1) % 3] * across[(k + 2) % 3] - along[(k + 2) % 3] * across[(k + 1) % 3];
                const double length = std::hypot(n[0], n[1], n[2]);
                for (double& x : n) x /= length;
                normals.push_back(n);
            }
        const auto at = [&](int r, int c) { return r * (columns + 1) + c; };
        for (int r = 0; r < rows; ++r)
            for (int c = 0; c < columns; ++c) {
                triangles.push_back({at(r, c), at(r, c + 1), at(r + 1, c + 1)});
                triangles.push_back({at(r, c), at(r + 1, c + 1), at(r + 1, c)});
            }
    }
};

// Hills of a unit or two, seen from +z.
inline std::array<double, 3> hills(double u, double v) {
    const double x = 2 * u - 1, y = 2 * v - 1;
    return {x, y, 0.12 * std::sin(4 * x) * std::cos(3 * y)};
}

// A closed ball of radius 1 (with poles of no area); u goes around.
inline std::array<double, 3> ball_at(double u, double v) {
    const double turn = 2 * std::numbers::pi * u, polar = std::numbers::pi * (1 - v);
    return {std::sin(polar) * std::sin(turn), std::cos(polar), std::sin(polar) * std::cos(turn)};
}

} // namespace unseen::app::testing
