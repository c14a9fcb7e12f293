Mass of two_springs                                                     HAND    
             3             1             1             1             0
RSA                        3             3             3             0
(8I5)           (8I5)           (3D12.4)            
    1    2    3    4
    1    2    3
  5.0000D-01  2.5000D-01  2.5000D-01
