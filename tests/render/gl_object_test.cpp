// Ownership of GL objects.
#include "gl_test.h"

#include <type_traits>

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include "gl_object.h"

namespace gl_object_test {

using namespace unseen::render;
using GlObjectTest = unseen::render::testing::GlTest;

static_assert(!std::is_copy_constructible_v<Buffer> && !std::is_copy_assignable_v<Buffer>);
static_assert(std::is_nothrow_move_constructible_v<Buffer> && std::is_nothrow_move_assignable_v<Buffer>);
static_assert(!std::is_convertible_v<unsigned, Buffer>, "an id does not become an owner by accident");

TEST_F(GlObjectTest, OwnsNothingByDefault) {
    const Buffer buffer;
    EXPECT_EQ(buffer.id(), 0u);
    EXPECT_FALSE(buffer);
}

TEST_F(GlObjectTest, IsDeletedWithItsOwner) {
    GLuint id = 0;
    {
        const Buffer buffer = Buffer::create("short-lived");
        id = buffer.id();
        EXPECT_TRUE(glIsBuffer(id));
    }
    EXPECT_FALSE(glIsBuffer(id));
}

TEST_F(GlObjectTest, LeavesNothingBehindWhenMovedFrom) {
    Buffer first = Buffer::create("moved");
    const GLuint id = first.id();
    const Buffer second = std::move(first);
    EXPECT_EQ(first.id(), 0u); // NOLINT(bugprone-use-after-move): that is the promise
    EXPECT_EQ(second.id(), id);
    EXPECT_TRUE(glIsBuffer(id));
}

TEST_F(GlObjectTest, DeletesTheOldObjectOnMoveAssignment) {
    GLuint old_id = 0, new_id = 0;
    {
        Buffer target = Buffer::create("old");
        old_id = target.id();
        {
            Buffer source = Buffer::create("new");
            new_id = source.id();
            target = std::move(source);
        }
        EXPECT_EQ(target.id(), new_id);
        EXPECT_FALSE(glIsBuffer(old_id));
        EXPECT_TRUE(glIsBuffer(new_id));
    }
    EXPECT_FALSE(glIsBuffer(new_id));
}

TEST_F(GlObjectTest, GivesUpAndTakesOverOwnership) {
    GLuint id = 0;
    {
        Texture2d texture = Texture2d::create("released");
        id = texture.release();
        EXPECT_EQ(texture.id(), 0u);
    }
    EXPECT_TRUE(glIsTexture(id));
    { const Texture2d owner = Texture2d::wrap(id); }
    EXPECT_FALSE(glIsTexture(id));
}

TEST_F(GlObjectTest, CarriesItsLabel) {
    const Renderbuffer object = Renderbuffer::create("a label");
    char text[64] = "";
    GLsizei size = 0;
    glGetObjectLabel(GL_RENDERBUFFER, object.id(), sizeof text, &size, text);
    EXPECT_EQ(std::string(text), "a label");
}

TEST_F(GlObjectTest, MakesEveryKind) {
    EXPECT_TRUE(glIsBuffer(Buffer::create("b").id()));
    EXPECT_TRUE(glIsVertexArray(VertexArray::create("v").id()));
    EXPECT_TRUE(glIsTexture(Texture2d::create("t").id()));
    EXPECT_TRUE(glIsRenderbuffer(Renderbuffer::create("r").id()));
    EXPECT_TRUE(glIsFramebuffer(FramebufferObject::create("f").id()));
    EXPECT_TRUE(glIsProgram(ProgramObject::create("p").id()));
}

} // namespace gl_object_test
