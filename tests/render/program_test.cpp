// Shader programs: what compiles, and what is said about what does not.
#include "gl_test.h"

#include "program.h"

namespace program_test {

using namespace unseen::render;
using ProgramTest = unseen::render::testing::GlTest;
using Stage = ShaderSource::Stage;

constexpr std::string_view vertex = "layout(location = 0) uniform mat4 m;\n"
                                    "void main() { gl_Position = m * vec4(0.0, 0.0, 0.0, 1.0); }\n";
constexpr std::string_view fragment = "layout(location = 1) uniform float grey;\n"
                                      "layout(location = 0) out vec4 colour;\n"
                                      "#ifdef GREY\n"
                                      "void main() { colour = vec4(grey); }\n"
                                      "#endif\n";

TEST_F(ProgramTest, LinksWithDefinesAndTakesUniforms) {
    const ShaderSource sources[] = {{Stage::vertex, vertex}, {Stage::fragment, fragment}};
    const std::string_view defines[] = {"GREY"};
    const auto program = require(Program::build("grey", sources, defines));
    program->set(0, glm::mat4(1));
    program->set(1, 0.5f);
    program->use();
    EXPECT_EQ(context().take_errors(), "");
}

TEST_F(ProgramTest, NamesProgramStageAndLineOfAnError) {
    const ShaderSource sources[] = {{Stage::vertex, "void main() {\n    nonsense;\n}\n"}};
    const auto program = Program::build("broken", sources);
    ASSERT_FALSE(program);
    EXPECT_THAT(program.error().message, ::testing::HasSubstr("'broken'"));
    EXPECT_THAT(program.error().message, ::testing::HasSubstr("vertex"));
    EXPECT_THAT(program.error().message, ::testing::ContainsRegex("[:(]2[:()]")) << "line 2 of the source";
    EXPECT_THAT(program.error().message, ::testing::HasSubstr("nonsense"));
    context().take_errors(); // a driver may report the failure there as well
}

TEST_F(ProgramTest, SaysWhyItDoesNotLink) {
    const ShaderSource sources[] = {{Stage::vertex, vertex}, {Stage::fragment, fragment}}; // no main: GREY is undefined
    EXPECT_THAT(error_in(Program::build("unlinked", sources)), ::testing::HasSubstr("'unlinked'"));
    context().take_errors();
}

TEST_F(ProgramTest, OwnsNothingWhenMovedFrom) {
    const ShaderSource sources[] = {{Stage::vertex, vertex}};
    auto program = require(Program::build("moved", sources));
    const Program taken = std::move(*program);
    EXPECT_NE(taken.id(), 0u);
    EXPECT_EQ(program->id(), 0u); // NOLINT(bugprone-use-after-move)
}

} // namespace program_test
