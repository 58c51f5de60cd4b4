// Files and names that were made, or happen, to do harm: nothing waits for ever, nothing that is read is overwritten,
// nothing is left behind, and memory is bounded by what a file can justify.
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "mesh_files.h"
#include "run_command.h"

namespace unseen::app::testing {
namespace {

using Words = Words;

class HostileFilesTest : public CommandTest {
protected:
    // Ends after so many seconds, with status 124.
    Outcome run_within(int seconds, Words words) const {
        return run_program(std::move(joined({"/usr/bin/timeout", std::to_string(seconds), UNSEEN_COMMAND}, words)));
    }

    // A ball with a texture in a library of materials.
    void write_painted_ball() const {
        write_ball("plain.obj", 6, 8);
        std::istringstream plain(read_text(path("plain.obj")));
        std::string text = "mtllib ball.mtl\nvt 0 0\nusemtl paint\n";
        for (std::string line, word; std::getline(plain, line); text += line + "\n")
            if (line[0] == 'f')
                for (std::istringstream words(std::exchange(line, "f").substr(1)); words >> word;)
                    line += " " + word + "/1";
        write_text(path("ball.obj"), text);
        write_text(path("ball.mtl"), "newmtl paint\nmap_Kd tex.png\nbump tex0007.png\n");
        for (const char* name : {"tex.png", "tex0007.png"})
            ASSERT_TRUE(perception::write_image(path(name), {2, 2, 3, std::vector<float>(12, 0.5F)}));
    }
};

TEST_F(HostileFilesTest, WaitForNoPipeThatNobodyWritesToAndReadNoDevice) {
    build_ball();
    ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
    const std::vector<Words> before = {{"render", "ball.vdt", "-o", "o.png", "--lights"},
                                       {"render", "ball.vdt", "-o", "o.png", "--display"},
                                       {"render", "ball.vdt", "-o", "o.png", "--observer"},
                                       {"render", "ball.vdt", "-o", "o.png", "--csf"},
                                       {"render", "ball.vdt", "-o", "f%d.png", "--path"},
                                       {"csf", "--frequency", "4", "--luminance", "1", "--csf"},
                                       {"compare", "pipe"},
                                       {"study", "analyse"},
                                       {"info"},
                                       {"build", "-o", "o.vdt"}};
    for (const char* input : {"pipe", "/dev/zero", "/dev/null"}) {
        for (Words words : before) {
            words.push_back(input);
            const Outcome outcome = run_within(20, words);
            EXPECT_EQ(outcome.status, 1) << ::testing::PrintToString(words) << outcome.err;
            EXPECT_THAT(outcome.err, HasSubstr(words[0] == "compare" ? "pipe" : input));
        }
    }
}

TEST_F(HostileFilesTest, ReadWhatAPipesWriterHasToSay) {
    succeed({"csf", "--table", "--save-table", "own.json"});
    const Outcome outcome =
        run_program({"/bin/bash", "-c",
                     "'" UNSEEN_COMMAND "' csf --frequency 4 --luminance 100 --csf <(sleep 0.2; cat '" +
                         path("own.json").string() + "')"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
}

TEST_F(HostileFilesTest, OverwriteNothingThatTheModelNames) {
    write_painted_ball();
    write_text(path("ball.csv"), "eye_x,eye_y,eye_z,target_x,target_y,target_z\n0,0,5,0,0,0\n");
    const std::set<std::string> before = files();
    const std::string texture = read_text(path("tex.png")), library = read_text(path("ball.mtl"));
    const std::vector<std::pair<Words, std::string>> table = {
        {{"render", "ball.obj", "-o", "tex.png"}, "tex.png"},
        {{"render", "ball.obj", "-o", "new.png", "--json", "ball.mtl"}, "ball.mtl"},
        {{"render", "ball.obj", "-o", "tex%04d.png", "--path", "ball.csv"}, "tex%04d.png"},
        {{"sheet", "ball.obj", "-o", "new.png", "--maps", "tex.png"}, "tex.png"},
        {{"simplify", "ball.obj", "-o", "new.ply", "--json", "tex.png"}, "tex.png"},
        {{"tradeoff", "ball.obj", "--csv", "tex.png"}, "tex.png"},
        {{"build", "ball.obj", "-o", "new.vdt", "--json", "tex.png"}, "tex.png"}};
    for (const auto& [words, output] : table)
        EXPECT_THAT(run(words), fails(1, HasSubstr("'" + output + "' is read: give the output another name.")))
            << ::testing::PrintToString(words);
    EXPECT_EQ(files(), before);
    EXPECT_TRUE(read_text(path("tex.png")) == texture && read_text(path("ball.mtl")) == library);
}

TEST_F(HostileFilesTest, AreNotQuotedAtLength) {
    nlohmann::json scene = nlohmann::json::parse(mesh_files::gltf_triangle_json(
        R"([{"mesh":0,"name":"a"},{"mesh":0,"name":"b"}])", R"({"byteLength":42,"uri":"triangle.bin"})"));
    write_text(path("triangle.bin"), mesh_files::gltf_triangle_data());
    const auto printed_of = [&](const nlohmann::json& document) {
        write_text(path("long.gltf"), document.dump());
        const Outcome outcome = run({"info", "long.gltf", "--as", "scene"});
        return outcome.out.size() + outcome.err.size();
    };
    const std::size_t usual = printed_of(scene);
    nlohmann::json named = scene, typed = scene, extended = scene;
    named["nodes"][0]["name"] = std::string(1'000'000, 'n');
    typed["accessors"][0]["type"] = std::string(100'000, 't');
    for (int i = 0; i < 10'000; ++i) extended["extensionsUsed"].push_back("extension " + std::to_string(i));
    for (const nlohmann::json& document : {named, typed, extended}) EXPECT_LT(printed_of(document), usual + 5000);
}

TEST_F(HostileFilesTest, RefuseEmptyValues) {
    build_ball();
    for (const Words& words : {Words{"info", "ball.vdt", "--lights", ""}, Words{"info", "ball.vdt", "--display="}}) {
        EXPECT_THAT(run(words), fails(2, HasSubstr(" has an empty value: give one, or leave the option out.")));
    }
}

TEST_F(HostileFilesTest, CleanUpAfterAWriterThatWasKilled) {
    build_ball();
    fs::create_directory(path("f"));
    write_text(path("f/.unseen-0123456789ab.tmp"), "half a picture");
    write_text(path("path.csv"), "eye_x,eye_y,eye_z,target_x,target_y,target_z\n0,0,5,0,0,0\n");
    const Outcome outcome = run({"render", "ball.vdt", "-o", "f/%04d.png", "--path", "path.csv", "--size", "16x16"});
    EXPECT_TRUE(outcome.status == 0 || outcome.err.find("No OpenGL") != std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(path("f/.unseen-0123456789ab.tmp")));
}

TEST_F(HostileFilesTest, LeaveNoEmptyFolderBehind) {
    build_ball();
    const fs::path log = folder().string() + ".log";
    const pid_t process = start({"study", "make", "ball.vdt", "-o", "study"}, log, log);
    for (int i = 0; i < 1000 && !fs::exists(path("study")); ++i) usleep(1'000);
    kill(process, SIGTERM);
    EXPECT_THAT(wait_for(process), ::testing::AnyOf(-SIGTERM, 1)); // 1: there is no OpenGL
    for (const fs::path& file : {log, fs::path(log.string() + ".in")}) fs::remove(file);
    EXPECT_FALSE(fs::exists(path("study")));
}

} // namespace
} // namespace unseen::app::testing
