// Levels selected within a budget: the search against all choices and against whole pictures, its file, and following.
#include <unseen/session/internal/selection_search.h>
#include <unseen/session/internal/selections.h>

#include <unseen/perception/judge.h>

#include "built.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"

namespace selection_test {

using namespace unseen;
using namespace unseen::session;

constexpr double rounding = 1e-9; // of sums over some thousand windows, each to some 1e-15

// Discs with stripes, at depths of their own; coarser levels have fewer stripes and ragged edges.
LayeredPicture discs(int count, int levels, unsigned seed, SelectionQuality quality = SelectionQuality::ssim) {
    std::mt19937 random(seed);
    const auto next = [&](int low, int high) {
        return low + static_cast<int>(random() % static_cast<unsigned>(high - low + 1));
    };
    const float unit = quality == SelectionQuality::ssim ? 1.0F : 0.4F; // codes, or cd/m2
    LayeredPicture picture;
    picture.width = 72, picture.height = 56;
    const std::size_t pixels = 72 * 56;
    picture.background.assign(pixels, 120 * unit);
    picture.background_depth.assign(pixels, 0);
    for (int i = 0; i < count; ++i) {
        ObjectImages& object = picture.objects.emplace_back();
        object.object = static_cast<std::size_t>(2 * i);
        const int radius = next(5, 14), x0 = next(0, 71), y0 = next(0, 55);
        const float depth = 0.1F + 0.01F * static_cast<float>(next(0, 60)), tone = static_cast<float>(next(20, 230));
        const auto triangles = static_cast<std::uint32_t>(next(400, 3000));
        for (int level = 0; level < levels; ++level) {
            object.triangles.push_back(triangles >> level);
            LevelImage& image = object.levels.emplace_back();
            image.box = {std::max(x0 - radius, 0), std::max(y0 - radius, 0), std::min(x0 + radius + 1, 72),
                         std::min(y0 + radius + 1, 56)};
            for (int y = image.box.top; y < image.box.bottom; ++y)
                for (int x = image.box.left; x < image.box.right; ++x) {
                    const int dx = x - x0, dy = y - y0, rag = level == 0 ? 0 : (x * 7 + y * 3) % (level + 1);
                    const bool is_in = dx * dx + dy * dy <= (radius - rag) * (radius - rag);
                    image.depth.push_back(is_in ? depth : 0);
                    image.values.push_back(std::round(tone + 20 * static_cast<float>((dx >> level) % 2)) * unit);
                }
        }
    }
    return picture;
}

perception::Image image_of(const LayeredPicture& picture, const std::vector<float>& codes) {
    perception::Image image{picture.width, picture.height, 1, codes};
    for (float& v : image.values) v /= 255;
    return image;
}

std::vector<int> at_level(const LayeredPicture& picture, int level) {
    return std::vector<int>(picture.objects.size(), level);
}

std::uint64_t triangles_of(const LayeredPicture& picture, const std::vector<int>& levels) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < levels.size(); ++i)
        sum += picture.objects[i].triangles[static_cast<std::size_t>(levels[i])];
    return sum;
}

// Of a whole picture, whatever is held; equal but for the order of the sums.
double loss_of(const PictureLoss& loss, const std::vector<float>& picture) {
    return loss.total() + loss.change(picture, {0, 0, 72, 56});
}

TEST(PictureLoss, IsSsimOfTheWholePicture) {
    const LayeredPicture picture = discs(6, 4, 1);
    const auto full = put_together(picture, at_level(picture, 0));
    const auto loss = require(PictureLoss::create(SelectionQuality::ssim, picture.width, picture.height, full));
    EXPECT_EQ(loss->total(), 0);
    for (int level = 1; level < 4; ++level) {
        const auto coarse = put_together(picture, at_level(picture, level));
        const auto ssim = require(perception::ssim(image_of(picture, full), image_of(picture, coarse)));
        EXPECT_NEAR(loss_of(*loss, coarse) / loss->places(), 1 - *ssim, rounding);
        EXPECT_GT(loss_of(*loss, coarse), 0.1) << "there is something to see";
    }
}

TEST(PictureLoss, CountsPixelsBeyondTheThresholdsOfTheJudge) {
    for (const auto quality : {SelectionQuality::pixels, SelectionQuality::contrast}) {
        const LayeredPicture picture = discs(6, 4, 1, quality);
        const auto full = put_together(picture, at_level(picture, 0));
        const auto loss = require(PictureLoss::create(quality, picture.width, picture.height, full));
        const auto thresholds = require(perception::threshold_map_modern({picture.width, picture.height, 1, full}, {}));
        const auto coarse = put_together(picture, at_level(picture, 3));
        double expected = 0;
        for (std::size_t i = 0; i < full.size(); ++i) {
            const double steps = std::abs(coarse[i] - full[i]) / thresholds->values[i];
            if (steps > 1) expected += quality == SelectionQuality::pixels ? 1 : steps - 1;
        }
        EXPECT_NEAR(loss_of(*loss, coarse), expected, 1e-4 * expected) << "steps are divided in float here";
        EXPECT_GT(expected, 10);
    }
}

// What is re-evaluated in a rectangle alone is what the whole picture loses.
TEST(PictureLoss, OfARectangleIsThatOfTheWholePicture) {
    for (const auto quality : {SelectionQuality::ssim, SelectionQuality::pixels, SelectionQuality::contrast}) {
        const LayeredPicture picture = discs(9, 4, 2, quality);
        std::vector<int> levels = at_level(picture, 0);
        auto loss = require(PictureLoss::create(quality, picture.width, picture.height, put_together(picture, levels)));
        std::mt19937 random(3);
        for (int step = 0; step < 60; ++step) {
            const std::size_t i = random() % levels.size();
            const int before = levels[i];
            levels[i] = static_cast<int>(random() % 4);
            const auto next = put_together(picture, levels);
            const PixelRect changed = united(picture.objects[i].levels[static_cast<std::size_t>(before)].box,
                                             picture.objects[i].levels[static_cast<std::size_t>(levels[i])].box);
            const double whole = loss_of(*loss, next), held = loss->total();
            EXPECT_NEAR(loss->change(next, changed), whole - held, rounding * loss->places());
            loss->take(next, changed);
            EXPECT_NEAR(loss->total(), whole, rounding * loss->places());
        }
    }
}

TEST(PictureLoss, RefusesWhatItCannotCompare) {
    EXPECT_FALSE(PictureLoss::create(SelectionQuality::ssim, 10, 40, std::vector<float>(400)));
    EXPECT_FALSE(PictureLoss::create(SelectionQuality::ssim, 20, 20, std::vector<float>(399)));
    std::vector<float> broken(400);
    broken[7] = std::nanf("");
    EXPECT_THAT(error_in(PictureLoss::create(SelectionQuality::ssim, 20, 20, broken)), HasSubstr("Value 7"));
}

// The thesis's algorithm written down once more, with whole pictures.
std::vector<int> plain_greedy(const LayeredPicture& picture, std::uint64_t budget) {
    std::vector<int> levels = at_level(picture, 0);
    const auto loss =
        PictureLoss::create(SelectionQuality::ssim, picture.width, picture.height, put_together(picture, levels));
    while (triangles_of(picture, levels) > budget) {
        std::size_t best = levels.size();
        double least = 0;
        const double now = loss_of(*loss, put_together(picture, levels));
        for (std::size_t i = 0; i < levels.size(); ++i) {
            const auto& counts = picture.objects[i].triangles;
            if (levels[i] + 1 >= static_cast<int>(counts.size())) continue;
            std::vector<int> tried = levels;
            ++tried[i];
            const double cost = (loss_of(*loss, put_together(picture, tried)) - now) /
                                static_cast<double>(triangles_of(picture, levels) - triangles_of(picture, tried));
            if (best == levels.size() || cost < least) best = i, least = cost;
        }
        if (best == levels.size()) break;
        ++levels[best];
    }
    return levels;
}

TEST(GreedySelection, LowersWhatCostsLeastForATriangle) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
        const LayeredPicture picture = discs(8, 4, seed);
        const std::uint64_t budget = triangles_of(picture, at_level(picture, 0)) / 3;
        const std::vector<int> expected = plain_greedy(picture, budget);
        const auto found = require(select_greedily(picture, SelectionQuality::ssim, {}, budget));
        EXPECT_TRUE(found->holds);
        EXPECT_LE(found->triangles, budget);
        EXPECT_EQ(found->triangles, triangles_of(picture, found->levels));
        // But for what the rest of the budget raises again.
        for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_LE(found->levels[i], expected[i]) << "seed " << seed;
        const auto loss = PictureLoss::create(SelectionQuality::ssim, picture.width, picture.height,
                                              put_together(picture, at_level(picture, 0)));
        EXPECT_NEAR(found->loss, loss_of(*loss, put_together(picture, found->levels)), rounding * loss->places());
        EXPECT_LE(found->loss, loss_of(*loss, put_together(picture, expected)) + rounding);
    }
}

// By trying all levels.
double least_loss(const LayeredPicture& picture, std::uint64_t budget) {
    const auto loss = PictureLoss::create(SelectionQuality::ssim, picture.width, picture.height,
                                          put_together(picture, at_level(picture, 0)));
    double least = 1e30;
    std::vector<int> levels = at_level(picture, 0);
    for (;;) {
        if (triangles_of(picture, levels) <= budget)
            least = std::min(least, loss_of(*loss, put_together(picture, levels)));
        std::size_t i = 0;
        while (i < levels.size() && ++levels[i] == static_cast<int>(picture.objects[i].levels.size())) levels[i++] = 0;
        if (i == levels.size()) return least;
    }
}

TEST(GreedySelection, IsCloseToTheBestOfAll) {
    double greedy_loss = 0, best_loss = 0;
    for (unsigned seed = 1; seed <= 10; ++seed) {
        const LayeredPicture picture = discs(5, 3, seed);
        const std::uint64_t budget = triangles_of(picture, at_level(picture, 0)) / 2;
        const auto greedy = select_greedily(picture, SelectionQuality::ssim, {}, budget);
        ASSERT_TRUE(greedy);
        const double best = least_loss(picture, budget);
        EXPECT_GE(greedy->loss, best - rounding * 1000) << "seed " << seed;
        greedy_loss += greedy->loss, best_loss += best;
    }
    EXPECT_LT(greedy_loss, 1.3 * best_loss) << "a budget filled by five things leaves gaps";
}

TEST(GreedySelection, TakesHiddenObjectsFirst) {
    LayeredPicture picture = discs(3, 4, 5);
    for (LevelImage& image : picture.objects[1].levels) // behind everything, and in front of nothing
        std::fill(image.depth.begin(), image.depth.end(), 0.0F);
    const auto& counts = picture.objects[1].triangles;
    const std::uint64_t budget = triangles_of(picture, at_level(picture, 0)) - (counts[0] - counts[3]);
    const auto found = require(select_greedily(picture, SelectionQuality::ssim, {}, budget, true));
    EXPECT_EQ(found->levels, (std::vector<int>{0, 3, 0}));
    EXPECT_EQ(found->loss, 0);
    EXPECT_THAT(found->alone[1], testing::Each(0.0));
    EXPECT_THAT(found->alone[0], testing::Each(testing::Gt(0.0)));
}

TEST(GreedySelection, SaysThatABudgetCannotBeHeld) {
    const LayeredPicture picture = discs(3, 3, 1);
    const auto search = select_greedily(picture, SelectionQuality::ssim, {}, 1);
    ASSERT_TRUE(search);
    EXPECT_FALSE(search->holds);
    EXPECT_EQ(search->levels, at_level(picture, 2));
}

TEST(LevelsWithin, AreCloseToTheBestOfAll) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> share(0, 1);
    double ours = 0, best_of_all = 0;
    for (int trial = 0; trial < 40; ++trial) {
        std::vector<std::vector<std::uint32_t>> counts;
        std::vector<LevelCosts> objects;
        std::uint64_t all = 0;
        for (int i = 0; i < 6; ++i) {
            auto& own = counts.emplace_back();
            for (auto n = static_cast<std::uint32_t>(1000 + random() % 3000); own.size() < 4; n /= 2) own.push_back(n);
            all += own.front();
            LevelCosts costs;
            costs.costs.push_back(0);
            for (int k = 1; k < 4; ++k) costs.costs.push_back(costs.costs.back() + share(random) * k * k);
            objects.push_back(std::move(costs));
        }
        for (std::size_t i = 0; i < objects.size(); ++i) objects[i].triangles = counts[i];
        const std::uint64_t budget = all / 3;
        const auto cost = [&](const std::vector<int>& levels) {
            double sum = 0;
            for (std::size_t i = 0; i < levels.size(); ++i)
                sum += objects[i].costs[static_cast<std::size_t>(levels[i])];
            return sum;
        };
        double best = 1e30;
        for (int number = 0; number < 4096; ++number) {
            std::vector<int> levels;
            std::uint64_t sum = 0;
            for (int i = 0, rest = number; i < 6; ++i, rest /= 4) {
                levels.push_back(rest % 4);
                sum += counts[static_cast<std::size_t>(i)][static_cast<std::size_t>(rest % 4)];
            }
            if (sum <= budget) best = std::min(best, cost(levels));
        }
        const auto levels = levels_within(objects, budget);
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < levels.size(); ++i) sum += counts[i][static_cast<std::size_t>(levels[i])];
        EXPECT_LE(sum, budget);
        EXPECT_GE(cost(levels), best - 1e-12);
        ours += cost(levels), best_of_all += best;
    }
    EXPECT_LT(ours, 1.1 * best_of_all);
}

const vdtree::VertexTree& ball() {
    static const vdtree::VertexTree tree = support::built(shapes::bumpy_sphere(4, 0.05));
    return tree;
}

Scene balls(const std::vector<glm::dvec3>& places) {
    Scene scene;
    for (const glm::dvec3& at : places) {
        Object& object = scene.objects.emplace_back(Object{ball().share()});
        object.placement.translation = at;
    }
    return scene;
}

// A row of balls along x, and corners before it; what a ball's levels cost falls with the third power of the distance.
Selections::Data before(const Scene& scene) {
    Selections::Data s;
    s.budget = 2000;
    s.grid = {.origin = {-12, 0, 4}, .step = 1, .cells = {3, 0, 2}, .depth = 3};
    for (std::size_t i = 0; i < scene.objects.size(); ++i) s.triangles.push_back({1600, 800, 400, 200});
    s.scene = scene_fingerprint(scene, s.triangles);
    s.cells = cells_of(s.grid);
    std::vector<LatticePoint> places;
    for (const SelectionCell& cell : s.cells)
        for (const LatticePoint& p : corners_of(s.grid, cell)) places.push_back(p);
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    for (const LatticePoint& p : places) {
        SelectionCorner corner{p, std::vector<SelectionCamera>(4)};
        for (std::size_t i = 0; i < scene.objects.size(); ++i) {
            const double d = glm::length(scene.objects[i].placement.translation - s.grid.place(p));
            const auto cost = static_cast<float>(1000 / (d * d * d));
            corner.cameras[3].objects.push_back({static_cast<std::uint32_t>(i), 1, {cost, 3 * cost, 9 * cost}});
        }
        s.corners.push_back(std::move(corner));
    }
    return s;
}

Scene row() {
    std::vector<glm::dvec3> places;
    for (int i = -3; i <= 3; ++i) places.push_back({4.0 * i, 0, 0});
    return balls(places);
}

vdtree::View looking(glm::dvec3 eye) {
    vdtree::View view;
    view.eye = eye, view.target = eye - glm::dvec3(0, 0, 1);
    view.fov_y_degrees = 90, view.width = 640, view.height = 360;
    return view;
}

TEST(SelectionFile, ComesBackAsItWas) {
    const support::TempFolder folder;
    const Scene scene = row();
    const Selections::Data s = before(scene);
    ASSERT_TRUE(write_selections(folder / "a.sel", s));
    const auto back = require(read_selections(folder / "a.sel"));
    ASSERT_TRUE(write_selections(folder / "b.sel", *back));
    const auto bytes = [&](const char* name) {
        std::ifstream in(folder / name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    EXPECT_EQ(bytes("a.sel"), bytes("b.sel"));
    EXPECT_EQ(back->corners.size(), 12u);
    EXPECT_EQ(back->corners[5].cameras[3].objects[2].costs, s.corners[5].cameras[3].objects[2].costs);
    EXPECT_EQ(folder.file_count(), 2u);
}

TEST(SelectionFile, WithDamageIsRefused) {
    const support::TempFolder folder;
    ASSERT_TRUE(write_selections(folder / "a.sel", before(row())));
    std::ifstream in(folder / "a.sel", std::ios::binary);
    const std::string good(std::istreambuf_iterator<char>(in), {});
    const auto read = [&](const std::string& bytes) {
        std::ofstream(folder / "b.sel", std::ios::binary) << bytes;
        return read_selections(folder / "b.sel");
    };
    for (std::size_t size = 0; size < good.size(); size += 1 + size / 50)
        EXPECT_THAT(error_in(read(good.substr(0, size))), HasSubstr("b.sel")) << size;
    for (std::size_t at = 0; at < good.size(); at += 7) {
        std::string bad = good;
        bad[at] = static_cast<char>(bad[at] ^ 0x40);
        EXPECT_FALSE(read(bad)) << at;
    }
    EXPECT_FALSE(read_selections(folder / "none.sel"));
}

// What a file says is checked even where its sum is right, for sums can be made.
TEST(SelectionFile, ThatContradictsItselfIsRefused) {
    const support::TempFolder folder;
    const Selections::Data good = before(row());
    const auto refused = [&](const std::function<void(Selections::Data&)>& break_it) {
        Selections::Data bad = good;
        break_it(bad);
        EXPECT_TRUE(write_selections(folder / "a.sel", bad));
        const auto back = read_selections(folder / "a.sel");
        return back ? "it was read" : back.error().message;
    };
    EXPECT_THAT(refused([](Selections::Data& s) { s.corners[2].cameras[3].objects.back().object = 70; }),
                HasSubstr("there is not"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.corners[2].cameras[3].objects[1].costs[0] = std::nanf(""); }),
                HasSubstr("no number"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.corners[2].cameras[3].objects[1].level = 9; }),
                HasSubstr("no such level"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.corners[2].cameras.pop_back(); }), HasSubstr("cameras"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.corners.erase(s.corners.begin()); }),
                HasSubstr("corner of a cell"));
    EXPECT_THAT(refused([](Selections::Data& s) { std::swap(s.corners[0], s.corners[1]); }), HasSubstr("order"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.cells.clear(); }), HasSubstr("no cells"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.cells[0].size = 0; }), HasSubstr("cell"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.grid.step = std::nan(""); }), HasSubstr("step"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.grid.cells.x = 1 << 30; }), HasSubstr("cells"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.budget = 0; }), HasSubstr("budget"));
    EXPECT_THAT(refused([](Selections::Data& s) { s.triangles[1][2] = 5000; }), HasSubstr("do not fall"));
}

TEST(SelectionJournal, GoesOnBehindWhatIsWhole) {
    const support::TempFolder folder;
    const Selections::Data s = before(row());
    {
        auto journal = require(SelectionJournal::open(folder / "a.part", 7));
        for (int i = 0; i < 3; ++i) ASSERT_TRUE(journal->add(s.corners[static_cast<std::size_t>(i)]));
    }
    const auto size = std::filesystem::file_size(folder / "a.part");
    std::filesystem::resize_file(folder / "a.part", size - 5); // killed in the middle of the third
    auto again = require(SelectionJournal::open(folder / "a.part", 7));
    ASSERT_EQ(again->done().size(), 2u);
    EXPECT_EQ(again->done()[1].at, s.corners[1].at);
    ASSERT_TRUE(again->add(s.corners[2]));
    EXPECT_EQ(SelectionJournal::open(folder / "a.part", 7)->done().size(), 3u);
    EXPECT_EQ(std::filesystem::file_size(folder / "a.part"), size);
    EXPECT_EQ(SelectionJournal::open(folder / "a.part", 8)->done().size(), 0u) << "of another search";
}

TEST(SelectionGrid, HasCellsWithCorners) {
    const SelectionGrid ground{.cells = {2, 0, 3}, .depth = 1}, space{.cells = {2, 2, 1}, .depth = 0};
    EXPECT_EQ(cells_of(ground).size(), 6u);
    EXPECT_EQ(corners_of(ground, cells_of(ground)[0]).size(), 4u);
    EXPECT_EQ(cells_of(space).size(), 4u);
    EXPECT_EQ(corners_of(space, cells_of(space)[0]).size(), 8u);
}

TEST(SelectionFollower, KeepsTheBudgetAndGivesTrianglesToWhatIsNear) {
    const Scene scene = row();
    const Selections::Data s = before(scene);
    auto follower = require(SelectionFollower::create(Selections(s), scene, s.triangles));
    const auto chosen = require(follower->choose(looking({0, 0, 6})));
    EXPECT_TRUE(chosen->holds);
    EXPECT_LE(chosen->triangles, s.budget);
    EXPECT_LT(chosen->levels[3], chosen->levels[1]);
    const auto away = require(follower->choose({.eye = {0, 0, 6}, .target = {0, 0, 7}}));
    EXPECT_THAT(away->levels, testing::Each(-1));
    EXPECT_EQ(away->triangles, 0u);
}

TEST(SelectionFollower, ComesToRestAndDoesNotChangeManyAtOnce) {
    const Scene scene = row();
    const Selections::Data s = before(scene);
    auto follower = require(SelectionFollower::create(Selections(s), scene, s.triangles, {.most_changes = 2}));
    int changes = 0;
    for (int i = 0; i <= 200; ++i) {
        const auto chosen = require(follower->choose(looking({-10 + 0.1 * i, 0, 6})));
        EXPECT_LE(chosen->triangles, s.budget);
        EXPECT_LE(chosen->changes, 4) << "two that are worth it, and what a new object in the frame asks for";
        changes += chosen->changes;
    }
    EXPECT_GT(changes, 3);
    EXPECT_LT(changes, 80);
    // A trembling eye changes nothing once it has come to rest.
    changes = 0;
    for (int i = 0; i < 60; ++i) {
        const auto chosen = require(follower->choose(looking({1 + 0.05 * (i % 2), 0, 6})));
        if (i >= 20) changes += chosen->changes;
    }
    EXPECT_EQ(changes, 0);
}

TEST(SelectionFollower, RefusesAnotherScene) {
    const Scene scene = row();
    const Selections::Data s = before(scene);
    EXPECT_THAT(error_in(SelectionFollower::create(Selections(s), balls({{0, 0, 0}}), std::span(s.triangles).first(1))),
                HasSubstr("another scene"));
    auto levels = s.triangles;
    levels[0][1] = 700;
    EXPECT_FALSE(SelectionFollower::create(Selections(s), scene, levels));
}

} // namespace selection_test
