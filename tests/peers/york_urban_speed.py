# Without an argument the pictures of York Urban; else those of a pattern, such as 'FRAMES/hallway_640x480_*.png'.
import glob
from p5_vp import *
K=sys.argv[1] if len(sys.argv)>1 else os.path.join(os.environ.get('YAMABICO_DATA','../../../shared/data'),'york_urban','images','*.jpg')
ims=[cv2.imread(f,0) for f in sorted(glob.glob(K))]
def best(f,n=15):
    b=1e9
    for _ in range(n):
        t=time.perf_counter(); f(); b=min(b,time.perf_counter()-t)
    return b*1e6
g=ims[0]; d=np.empty_like(g); gx,gy=(np.empty(g.shape,np.int16) for _ in '12')  # into memory that is there already, as ours
print('median3 %.0f us, Scharr gx and gy %.0f us'%(best(lambda:cv2.medianBlur(g,3,d),200),best(lambda:(cv2.Scharr(g,cv2.CV_16S,1,0,gx),cv2.Scharr(g,cv2.CV_16S,0,1,gy)),200)))
for name,f in (('FLD',seg_fld),('FLD + RANSAC',lambda i:ransac(*prep(seg_fld(i)))),('FLD + voting',lambda i:vote(*prep(seg_fld(i)))),('EdgeDrawing',seg_ed)):
    t=[best(lambda:f(i)) for i in ims]; print('%s: median %.0f us over %d pictures'%(name,np.median(t),len(t)))
