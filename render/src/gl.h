// OpenGL 4.5 core, its functions taken directly from libOpenGL.
#pragma once

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>
