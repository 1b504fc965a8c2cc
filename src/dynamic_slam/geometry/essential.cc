#include "dynamic_slam/geometry/essential.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "dynamic_slam/geometry/polynomial.h"

namespace dynamic_slam {
namespace {

// Polynomials in x, y, z. Linear: x y z 1. Quadratic: xx xy xz x yy yz y zz z 1. Cubic, in the order in which
// Nister eliminates: xxx yyy xxy xyy xxz xx yyz yy xyz xy | xzz xz x yzz yz y zzz zz z 1.
using Linear = Eigen::Vector4d;
using Quadratic = Eigen::Matrix<double, 10, 1>;
using Cubic = Eigen::Matrix<double, 20, 1>;

Quadratic Multiply(const Linear& a, const Linear& b) {
  Quadratic q;
  q << a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0], a[0] * b[3] + a[3] * b[0],
      a[1] * b[1], a[1] * b[2] + a[2] * b[1], a[1] * b[3] + a[3] * b[1], a[2] * b[2],
      a[2] * b[3] + a[3] * b[2], a[3] * b[3];
  return q;
}

void AddProduct(const Quadratic& a, const Linear& b, Cubic* sum) {
  static constexpr int kTarget[10][4] = {{0, 2, 4, 5},     {2, 3, 8, 9},    {4, 8, 10, 11}, {5, 9, 11, 12},
                                         {3, 1, 6, 7},     {8, 6, 13, 14},  {9, 7, 14, 15}, {10, 13, 16, 17},
                                         {11, 14, 17, 18}, {12, 15, 18, 19}};
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) (*sum)[kTarget[i][j]] += a[i] * b[j];
  }
}

// A polynomial in z of fixed degree, from z^0 upwards.
template <int kDegree>
using Univariate = Eigen::Matrix<double, kDegree + 1, 1>;

template <int kA, int kB>
Univariate<kA + kB - 2> Convolve(const Eigen::Matrix<double, kA, 1>& a,
                                 const Eigen::Matrix<double, kB, 1>& b) {
  Univariate<kA + kB - 2> product = Univariate<kA + kB - 2>::Zero();
  for (int i = 0; i < kA; ++i) {
    for (int j = 0; j < kB; ++j) product[i + j] += a[i] * b[j];
  }
  return product;
}

// Two unit vectors that span the plane normal to the unit vector t.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& t) {
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  int smallest;
  t.cwiseAbs().minCoeff(&smallest);
  axis[smallest] = 1;
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = t.cross(axis).normalized();
  basis.col(1) = t.cross(basis.col(0));
  return basis;
}

double TukeyCost(double r2, double cut2) {
  const double u = 1.0 - std::min(r2 / cut2, 1.0);
  return 1.0 - u * u * u;
}

}  // namespace

std::vector<Eigen::Matrix3d> FivePointEssential(const std::array<Eigen::Vector3d, 5>& first_rays,
                                                const std::array<Eigen::Vector3d, 5>& second_rays) {
  std::vector<Eigen::Matrix3d> solutions;
  // E = x X + y Y + z Z + W, the null space of the five epipolar constraints.
  Eigen::Matrix<double, 9, 5> constraints;
  for (int i = 0; i < 5; ++i) {
    for (int row = 0; row < 3; ++row) {
      constraints.col(i).segment<3>(3 * row) = second_rays[i][row] * first_rays[i];
    }
  }
  const Eigen::HouseholderQR<Eigen::Matrix<double, 9, 5>> qr(constraints);
  Eigen::Matrix<double, 9, 4> basis = Eigen::Matrix<double, 9, 4>::Zero();
  basis.bottomRows<4>().setIdentity();
  basis.applyOnTheLeft(qr.householderQ());
  Linear e[3][3];
  for (int i = 0; i < 9; ++i) e[i / 3][i % 3] = basis.row(i).transpose();

  // The ten cubic constraints: (E E' - trace(E E') / 2) E = 0 and det E = 0.
  Quadratic gram[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      gram[i][j] = Multiply(e[i][0], e[j][0]) + Multiply(e[i][1], e[j][1]) + Multiply(e[i][2], e[j][2]);
      if (i != j) gram[j][i] = gram[i][j];
    }
  }
  const Quadratic half_trace = 0.5 * (gram[0][0] + gram[1][1] + gram[2][2]);
  for (int i = 0; i < 3; ++i) gram[i][i] -= half_trace;
  Eigen::Matrix<double, 10, 20> cubics;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      Cubic sum = Cubic::Zero();
      for (int k = 0; k < 3; ++k) AddProduct(gram[i][k], e[k][j], &sum);
      cubics.row(3 * i + j) = sum.transpose();
    }
  }
  Cubic determinant = Cubic::Zero();
  for (int j = 0; j < 3; ++j) {
    const int k = (j + 1) % 3, l = (j + 2) % 3;
    AddProduct(Multiply(e[1][k], e[2][l]) - Multiply(e[1][l], e[2][k]), e[0][j], &determinant);
  }
  cubics.row(9) = determinant.transpose();

  const Eigen::PartialPivLU<Eigen::Matrix<double, 10, 10>> lu(cubics.leftCols<10>());
  const Eigen::Matrix<double, 10, 10> reduced = lu.solve(cubics.rightCols<10>());
  if (!reduced.allFinite()) return solutions;

  // Rows xxz, yyz, xyz minus z times rows xx, yy, xy: three equations B(z) (x, y, 1)' = 0.
  Univariate<3> bx[3], by[3];
  Univariate<4> b1[3];
  for (int i = 0; i < 3; ++i) {
    const auto p = reduced.row(4 + 2 * i), q = reduced.row(5 + 2 * i);
    bx[i] << p[2], p[1] - q[2], p[0] - q[1], -q[0];
    by[i] << p[5], p[4] - q[5], p[3] - q[4], -q[3];
    b1[i] << p[9], p[8] - q[9], p[7] - q[8], p[6] - q[7], -q[6];
  }
  Univariate<10> det = Univariate<10>::Zero();
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const Univariate<6> minor = Convolve(bx[j], by[k]) - Convolve(by[j], bx[k]);
    det += Convolve(minor, b1[i]);
  }
  std::array<double, 11> coefficients;
  Univariate<10>::Map(coefficients.data()) = det / det.cwiseAbs().maxCoeff();
  if (!Univariate<10>::Map(coefficients.data()).allFinite()) return solutions;

  std::array<double, 20> roots;
  const int root_count = RealRoots<10>(coefficients, &roots);
  for (int r = 0; r < root_count && solutions.size() < 10; ++r) {
    const double z = roots[r];
    Eigen::Matrix3d B;
    for (int i = 0; i < 3; ++i) {
      B(i, 0) = ((bx[i][3] * z + bx[i][2]) * z + bx[i][1]) * z + bx[i][0];
      B(i, 1) = ((by[i][3] * z + by[i][2]) * z + by[i][1]) * z + by[i][0];
      B(i, 2) = (((b1[i][4] * z + b1[i][3]) * z + b1[i][2]) * z + b1[i][1]) * z + b1[i][0];
    }
    Eigen::Vector3d null = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d candidate = B.row(i).cross(B.row((i + 1) % 3)).transpose();
      if (candidate.squaredNorm() > null.squaredNorm()) null = candidate;
    }
    const Eigen::Vector4d xyz1(null[0], null[1], z * null[2], null[2]);
    const Eigen::Matrix<double, 9, 1> flat = (basis * xyz1).normalized();
    if (!flat.allFinite()) continue;
    solutions.push_back(Eigen::Matrix<double, 3, 3, Eigen::RowMajor>::Map(flat.data()));
  }
  return solutions;
}

std::array<Rigid3, 4> PosesFromEssential(const Eigen::Matrix3d& E) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
  if (U.determinant() < 0) U.col(2) *= -1;
  if (V.determinant() < 0) V.col(2) *= -1;
  Eigen::Matrix3d W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const Eigen::Matrix3d R = U * W * V.transpose(), R_twisted = U * W.transpose() * V.transpose();
  const Eigen::Vector3d t = U.col(2);
  return {Rigid3(R, t), Rigid3(R, -t), Rigid3(R_twisted, t), Rigid3(R_twisted, -t)};
}

Rigid3 RefineRelativePose(std::span<const PixelPair> pairs, double fx, double fy, double cut_px,
                          int iterations, const Rigid3& second_from_first) {
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  const Eigen::DiagonalMatrix<double, 3> inverse_k(1.0 / fx, 1.0 / fy, 1.0);
  const double cut2 = cut_px * cut_px;
  Rigid3 pose = second_from_first;
  pose.translation.normalize();

  const auto cost_of = [&](const Rigid3& candidate) {
    const Eigen::Matrix3d F = inverse_k * EssentialFromPose(candidate) * inverse_k;
    double cost = 0;
    for (const PixelPair& m : pairs) {
      const double a0 = F(0, 0) * m.x1 + F(0, 1) * m.y1 + F(0, 2),
                   a1 = F(1, 0) * m.x1 + F(1, 1) * m.y1 + F(1, 2);
      const double b0 = F(0, 0) * m.x2 + F(1, 0) * m.y2 + F(2, 0),
                   b1 = F(0, 1) * m.x2 + F(1, 1) * m.y2 + F(2, 1);
      const double n = m.x2 * a0 + m.y2 * a1 + F(2, 0) * m.x1 + F(2, 1) * m.y1 + F(2, 2);
      cost += TukeyCost(n * n / (a0 * a0 + a1 * a1 + b0 * b0 + b1 * b1 + 1e-300), cut2);
    }
    return cost;
  };

  double cost = cost_of(pose);
  double damping = 1e-6;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::Matrix3d E = EssentialFromPose(pose);
    const Eigen::Matrix3d F = inverse_k * E * inverse_k;
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(pose.translation);
    const Eigen::Matrix3d R = pose.Matrix(), T = Skew(pose.translation);
    Eigen::Matrix<double, 5, 9> D;  // of the entries of F, row by row, by the five parameters
    for (int k = 0; k < 5; ++k) {
      const Eigen::Matrix3d dE = k < 3 ? Eigen::Matrix3d(T * Skew(Eigen::Vector3d::Unit(k)) * R)
                                       : Eigen::Matrix3d(Skew(basis.col(k - 3)) * R);
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> dF = inverse_k * dE * inverse_k;
      D.row(k) = Vector9::Map(dF.data()).transpose();
    }
    Eigen::Matrix<double, 5, 5> A = Eigen::Matrix<double, 5, 5>::Zero();
    Vector5 b = Vector5::Zero();
    for (const PixelPair& m : pairs) {
      const double a0 = F(0, 0) * m.x1 + F(0, 1) * m.y1 + F(0, 2),
                   a1 = F(1, 0) * m.x1 + F(1, 1) * m.y1 + F(1, 2);
      const double b0 = F(0, 0) * m.x2 + F(1, 0) * m.y2 + F(2, 0),
                   b1 = F(0, 1) * m.x2 + F(1, 1) * m.y2 + F(2, 1);
      const double n = m.x2 * a0 + m.y2 * a1 + F(2, 0) * m.x1 + F(2, 1) * m.y1 + F(2, 2);
      const double inverse_d = 1.0 / std::sqrt(a0 * a0 + a1 * a1 + b0 * b0 + b1 * b1 + 1e-300);
      const double r = n * inverse_d;
      const double u = 1.0 - r * r / cut2;
      if (u <= 0) continue;
      const double s = r * inverse_d;  // r = n / d, d r = (d n - s (a . da + b . db)) / d
      Vector9 g;
      const double c0 = m.x2 - s * a0, c1 = m.y2 - s * a1, sb0 = s * b0, sb1 = s * b1;
      g << c0 * m.x1 - sb0 * m.x2, c0 * m.y1 - sb1 * m.x2, c0,  //
          c1 * m.x1 - sb0 * m.y2, c1 * m.y1 - sb1 * m.y2, c1,   //
          m.x1 - sb0, m.y1 - sb1, 1;
      Vector5 J = Vector5::Zero();
      for (int k = 0; k < 9; ++k) J += g[k] * D.col(k);
      const double w = u * u * inverse_d;
      A.noalias() += (w * inverse_d) * J * J.transpose();
      b += (w * r) * J;
    }
    A.diagonal() *= 1.0 + damping;
    const Vector5 step = -A.ldlt().solve(b);
    if (!step.allFinite()) break;
    const Rigid3 candidate(ExpSo3(step.head<3>()) * pose.rotation,
                           (pose.translation + basis * step.tail<2>()).normalized());
    const double candidate_cost = cost_of(candidate);
    if (candidate_cost < cost) {
      const bool converged = cost - candidate_cost < 1e-7 * cost;
      pose = candidate;
      cost = candidate_cost;
      damping = std::max(damping * 0.1, 1e-9);
      if (converged) break;
    } else {
      if (damping > 1e3 || step.squaredNorm() < 1e-20) break;
      damping = std::max(damping * 100, 1e-3);
    }
  }
  return pose;
}

}  // namespace dynamic_slam
