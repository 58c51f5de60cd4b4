// unseen compare: counts, maps, and the judges.
#include "run_command.h"

#include <unseen/perception/image.h>

namespace compare_command_test {

using namespace unseen::app::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;
using unseen::perception::Image;

class CompareTest : public CommandTest {
protected:
    // A disc of two degrees on grey, in the middle of a field of four.
    Image disc(float inside, float outside) const {
        Image image{128, 128, 1, {}};
        for (int y = 0; y < 128; ++y)
            for (int x = 0; x < 128; ++x)
                image.values.push_back(std::hypot(x - 63.5, y - 63.5) < 34 ? inside : outside);
        return image;
    }
    void write(const std::string& name, const Image& image) const {
        const auto written = require(unseen::perception::write_image(path(name), image));
    }
    Json compare(Words words) const {
        words.insert(words.begin(), "compare");
        words.insert(words.end(), {"--json", "-"});
        const Json report = succeed(words).json();
        EXPECT_THAT(keys(report), UnorderedElementsAre("visible_at", "different_pixels", "visible_pixels", "pixels",
                                                       "max_ratio", "ssim", "judges_colour", "device"));
        EXPECT_TRUE(report["visible_pixels"].is_number_unsigned()) << report;
        EXPECT_EQ(report["pixels"], 128 * 128) << report;
        return report;
    }
};

TEST_F(CompareTest, IdenticalImagesShowNothing) {
    write("a.pfm", disc(30, 20));
    write("a.exr", disc(30, 20));
    write("a.png", disc(0.6f, 0.5f));
    for (const std::string model : {"modern", "second", "rpg99"}) {
        for (const std::string name : {"a.pfm", "a.exr", "a.png"}) {
            const Json report = compare({name, name, "--model", model});
            EXPECT_EQ(report["visible_pixels"], 0) << name << model;
            EXPECT_EQ(report["max_ratio"], 0.0) << name << model;
            if (name == "a.png") {
                EXPECT_NEAR(report["ssim"].get<double>(), 1, 1e-12);
            } else {
                EXPECT_TRUE(report["ssim"].is_null()) << name;
            }
        }
    }
}

TEST_F(CompareTest, ATenPercentStepIsVisible) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(22, 20));
    const Json report = compare({"a.pfm", "b.pfm"});
    EXPECT_GT(report["visible_pixels"], 100);
    EXPECT_GT(report["max_ratio"], 1.0);
}

TEST_F(CompareTest, ItIsLessVisibleAside) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(22, 20));
    const Json beside = compare({"a.pfm", "b.pfm", "--gaze", "-2000", "64"});
    EXPECT_LT(beside["max_ratio"], compare({"a.pfm", "b.pfm"})["max_ratio"]);
}

TEST_F(CompareTest, SeesForAnObserver) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(20.1f, 20));
    const auto seen = [&](const Words& more) {
        return compare(joined({"a.pfm", "b.pfm"}, more))["max_ratio"].get<double>();
    };
    const auto out = [&](const Words& more) { return run(joined({"compare", "a.pfm", "b.pfm"}, more)).out; };
    const double median = seen({"--observer", "median"});
    EXPECT_GT(median, 0);
    EXPECT_NEAR(seen({"--observer", "default"}) / median, 2, 1e-3);
    EXPECT_NEAR(seen({"--observer", "strict"}) / median, 2.7, 1e-3);
    EXPECT_EQ(seen({}), seen({"--observer", "default"}));
    EXPECT_EQ(seen({"--model", "modern"}), seen({}));
    EXPECT_THAT(out({}), HasSubstr("by the judge modern and the observer default (of measured people, 8.7% see more)"));

    const double second = seen({"--model", "second"});
    EXPECT_NE(second, seen({}));
    EXPECT_EQ(second, seen({"--model", "second", "--observer", "default"}));
    EXPECT_GT(seen({"--model", "second", "--observer", "strict"}), second);
    EXPECT_THAT(out({"--model", "second", "--observer", "median"}),
                HasSubstr("by the judge second and the observer median (of measured people, 65% see more)"));
}

// A model of sensitivity is a typical person's, a file some person's own.
TEST_F(CompareTest, SeesByAnotherSensitivity) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(20.1f, 20));
    EXPECT_EQ(compare({"a.pfm", "b.pfm", "--csf", "castle"}), compare({"a.pfm", "b.pfm"}));
    EXPECT_NE(compare({"a.pfm", "b.pfm", "--csf", "daly"}), compare({"a.pfm", "b.pfm"}));
    EXPECT_THAT(run({"compare", "a.pfm", "b.pfm", "--csf", "daly"}).out, HasSubstr("observer default (2 times daly)"));

    ASSERT_EQ(run({"csf", "--csf", "castle", "--save-table", "me.json"}).status, 0);
    const Json by_file = compare({"a.pfm", "b.pfm", "--csf", "me.json"});
    EXPECT_NEAR(by_file["max_ratio"].get<double>(),
                compare({"a.pfm", "b.pfm", "--observer", "median"})["max_ratio"].get<double>(), 0.01);
    EXPECT_THAT(run({"compare", "a.pfm", "b.pfm", "--csf", "me.json"}).out, HasSubstr("observer me.json, seen"));
}

TEST_F(CompareTest, RefusesWhatTheJudgeDoesNotKnow) {
    write("a.pfm", disc(20, 20));
    const auto error = [&](Words more) {
        const Outcome outcome = run(joined({"compare", "a.pfm", "a.pfm"}, more));
        EXPECT_NE(outcome.status, 0);
        return outcome.err;
    };
    EXPECT_THAT(error({"--model", "rpg99", "--observer", "strict"}),
                HasSubstr("--observer and --model rpg99 exclude each other"));
    EXPECT_THAT(error({"--observer", "strict", "--csf", "me.json"}),
                HasSubstr("--observer and --csf exclude each other"));
    EXPECT_THAT(error({"--model", "second", "--csf", "castle"}), HasSubstr("--csf and --model second"));
    EXPECT_THAT(error({"--model", "rpg99", "--csf", "castle"}), HasSubstr("--csf and --model rpg99"));
    EXPECT_THAT(error({"--model", "summing"}), HasSubstr("modern"));
}

TEST_F(CompareTest, PngIsDecodedByTheDisplay) {
    // 0.5 on a display of 100 over 0.5 cd/m2 with sRGB is 21.4 % of the span, and code 128 of 255 a little more.
    write("a.png", disc(0.5f, 0.5f));
    write("b.pfm", disc(21.977f, 21.977f));
    EXPECT_EQ(compare({"a.png", "b.pfm"})["visible_pixels"], 0);
    EXPECT_LT(compare({"a.png", "b.pfm"})["max_ratio"], 0.1);
    EXPECT_GT(compare({"a.png", "b.pfm", "--peak", "200"})["max_ratio"], 1.0);
    EXPECT_TRUE(compare({"a.png", "b.pfm"})["ssim"].is_null());
}

TEST_F(CompareTest, FailsAboveALimit) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(30, 20));
    const auto visible = compare({"a.pfm", "b.pfm"})["visible_pixels"].get<int>();
    ASSERT_GT(visible, 0);
    EXPECT_EQ(run({"compare", "a.pfm", "b.pfm", "--fail-above", std::to_string(visible)}).status, 0);
    EXPECT_EQ(run({"compare", "a.pfm", "b.pfm", "--fail-above", std::to_string(visible - 1)}).status, 1);
    EXPECT_EQ(run({"compare", "a.pfm", "a.pfm", "--fail-above", "0"}).status, 0);
}

TEST_F(CompareTest, WritesMaps) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(40, 20));
    for (const std::string model : {"modern", "second", "rpg99"}) {
        compare({"a.pfm", "b.pfm", "--model", model, "--map", "map.png"});
        const auto map = require(unseen::perception::read_image(path("map.png")));
        EXPECT_GE(map->image.width, 128);
        EXPECT_GT(map->image.height, 128 + 20) << "a scale below";
        EXPECT_EQ(map->image.channels, 3);
        // Red or yellow in the disc's rim, where the difference is seen; blue or black in the far corner.
        const Image& image = map->image;
        EXPECT_GT(image.at(64 + 33, 64, 0), image.at(64 + 33, 64, 2)) << model;
        fs::remove(path("map.png"));
    }
}

TEST_F(CompareTest, AMapThatCannotBeWrittenLeavesNoOtherFile) {
    write("a.pfm", disc(20, 20));
    const auto before = files();
    EXPECT_THAT(run({"compare", "a.pfm", "a.pfm", "--map", "a.pfm/map.png", "--json", "o.json"}),
                fails(1, IsAnErrorForPeople()));
    EXPECT_EQ(files(), before);
}

TEST_F(CompareTest, SizesMustMatch) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", Image{2, 1, 1, {1, 2}});
    const Outcome outcome = run({"compare", "a.pfm", "b.pfm"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_THAT(outcome.err, IsAnErrorForPeople());
    EXPECT_THAT(outcome.err, ::testing::AllOf(HasSubstr("128x128"), HasSubstr("2x1")));
}

TEST_F(CompareTest, TheGpuSaysWhatTheCpuSays) {
    write("a.pfm", disc(20, 20));
    write("b.pfm", disc(22, 20));
    const Outcome drawn = run({"compare", "a.pfm", "b.pfm", "--device", "gpu"});
    if (drawn.err.find("OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
    EXPECT_EQ(drawn.status, 0) << drawn.err;
    EXPECT_THAT(drawn.out, HasSubstr("on the GPU ("));
    for (const std::string model : {"modern", "second"}) {
        const Json on_gpu = compare({"a.pfm", "b.pfm", "--model", model, "--device", "gpu", "--gaze", "0", "5"});
        const Json on_cpu = compare({"a.pfm", "b.pfm", "--model", model, "--gaze", "0", "5"});
        EXPECT_EQ(on_gpu["device"], "gpu");
        EXPECT_EQ(on_cpu["device"], "cpu");
        EXPECT_NEAR(on_gpu["max_ratio"].get<double>() / on_cpu["max_ratio"].get<double>(), 1, 1e-3);
    }
    EXPECT_THAT(run({"compare", "a.pfm", "b.pfm", "--model", "rpg99", "--device", "gpu"}),
                fails(2, HasSubstr("--device")));
}

} // namespace compare_command_test
