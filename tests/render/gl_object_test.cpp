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

TEST_F(GlObjectTest, IsDeletedWithItsOwner) {
    GLuint id = 0;
    {
        const Buffer buffer = Buffer::create("short-lived");
        id = buffer.id();
        EXPECT_TRUE(glIsBuffer(id));
    }
    EXPECT_FALSE(glIsBuffer(id));
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

} // namespace gl_object_test
