#pragma GCC diagnostic ignored "-Wconversion"
#include <session_gpu/gpu_judge.h>
#include "gl_test.h"
#include <cstdio>
using namespace unseen;
using namespace unseen::session_gpu;
using T = render::testing::GlTest;
TEST_F(T, Dev) {
    perception::Image a{512,512,1,{}}, b;
    unsigned s=1; auto rnd=[&]{s=s*1664525u+1013904223u; return (s>>8)/16777216.f;};
    for(int i=0;i<512*512;++i) a.values.push_back(20+20*rnd());
    b=a; for(int y=200;y<300;++y) for(int x=200;x<300;++x) b.at(x,y)*=1.05f;
    for (int g=0;g<2;++g) for (auto p : {render::VisibilityPrecision::full, render::VisibilityPrecision::half}) {
    perception::JudgeOptions o; if(g) o.gaze_px=glm::dvec2(700,100);
    auto c=perception::Judge::create(a,o); auto cj=c->judge(b);
    auto j=GpuJudge::create(context(),a,o,p); ASSERT_TRUE(j)<<j.error().message;
    auto gj=j->judge(b); ASSERT_TRUE(gj)<<gj.error().message;
    auto m=j->threshold_map(); ASSERT_TRUE(m)<<m.error().message; auto cm=perception::threshold_map_modern(a,o);
    std::vector<double> e,et; for(size_t i=0;i<gj->pixels;++i){ e.push_back(std::abs(gj->visibility.values[i]-cj->visibility.values[i])/std::max(cj->visibility.values[i],1e-3f)); et.push_back(std::abs(m->values[i]-cm->values[i])/cm->values[i]);}
    std::sort(e.begin(),e.end()); std::sort(et.begin(),et.end());
    printf("g%d max %g %g vis %lu %lu err med %g p999 %g max %g thr p999 %g max %g\n",g,gj->max_ratio,cj->max_ratio,gj->visible_pixels,cj->visible_pixels,e[e.size()/2],e[size_t(e.size()*.999)],e.back(),et[size_t(et.size()*.999)],et.back());
    auto same=j->judge(a); printf("same %g\n", same->max_ratio);
    }
}
