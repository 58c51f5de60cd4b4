# Images and judges of image pairs. libpng and OpenEXR write the variants that our own writer does not.
find_package(PNG REQUIRED)
find_package(OpenEXR REQUIRED)
unseen_add_test(NAME perception_image SOURCES image_test.cpp
                DEPENDS unseen::perception PNG::PNG OpenEXR::OpenEXR LABELS unit)
unseen_add_test(NAME perception_judge_modern SOURCES judge_modern_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_judge_rpg99 SOURCES judge_rpg99_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_ssim SOURCES ssim_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_fast_math SOURCES fast_math_test.cpp
                DEPENDS unseen::perception PRIVATE_HEADERS perception LABELS unit)
unseen_add_test(NAME perception_summation SOURCES summation_test.cpp
                DEPENDS unseen::perception PRIVATE_HEADERS perception LABELS unit)
unseen_add_test(NAME perception_change SOURCES change_test.cpp DEPENDS unseen::perception LABELS unit)
